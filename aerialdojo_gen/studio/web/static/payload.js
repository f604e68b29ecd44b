// Reads what aerialdojo_gen/studio/web/payload.py packs: typed arrays over one buffer, textures decoded.

const at = (buffer, base, view, Type) => new Type(buffer, base + view.offset, view.bytes / Type.BYTES_PER_ELEMENT);

/** Fetch and read a scene. Returns {name, bounds_m, sun, zenith, horizon, nodes, boxes, groups}. */
export async function loadPayload(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`the scene did not load (${response.status}): ${await response.text()}`);
  return readPayload(await response.arrayBuffer());
}

export async function readPayload(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  if (header.version !== 1) throw new Error(`scene payload ${header.version} is not 1: reload the page`);
  const base = 4 + length;
  const groups = await Promise.all(header.groups.map(async (group) => ({
    size: group.size,
    holes: group.holes, bothSides: group.both_sides, unlit: group.unlit, behind: group.behind,
    beyond: group.beyond,
    position: at(buffer, base, group.position, Float32Array),
    index: at(buffer, base, group.index, Uint32Array),
    ranges: at(buffer, base, group.ranges, Uint32Array),
    colour: group.colour && at(buffer, base, group.colour, Uint8Array),
    uv: group.uv && at(buffer, base, group.uv, Float32Array),
    texels: group.layers && (await decode(buffer, base, group.size, group.layers)),
  })));
  return { ...header, boxes: at(buffer, base, header.boxes, Float32Array), groups };
}

const typeOf = (buffer, start) => (new Uint8Array(buffer, start, 1)[0] === 0xff ? "image/jpeg" : "image/png");

/** Decode PNG or JPEG layers of one size into the bytes of a texture array, RGBA. */
async function decode(buffer, base, [height, width], layers) {
  const texels = new Uint8Array(layers.length * width * height * 4);
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  const images = await Promise.all(layers.map((view) => createImageBitmap(
    new Blob([new Uint8Array(buffer, base + view.offset, view.bytes)], { type: typeOf(buffer, base + view.offset) }),
    { colorSpaceConversion: "none", premultiplyAlpha: "none" })));
  images.forEach((image, k) => {
    context.clearRect(0, 0, width, height);
    context.drawImage(image, 0, 0);
    const own = context.getImageData(0, 0, width, height).data;
    fillHoles(own);
    texels.set(own, k * width * height * 4);
    image.close();
  });
  return texels;
}

/** Give holes the mean colour of what is there: smaller sizes of a texture mix both. */
function fillHoles(rgba) {
  const sum = [0, 0, 0];
  let solid = 0;
  for (let i = 0; i < rgba.length; i += 4) {
    if (rgba[i + 3] < 128) continue;
    for (let c = 0; c < 3; c++) sum[c] += rgba[i + c];
    solid++;
  }
  if (!solid || 4 * solid === rgba.length) return;
  for (let i = 0; i < rgba.length; i += 4) {
    if (rgba[i + 3] < 128) for (let c = 0; c < 3; c++) rgba[i + c] = sum[c] / solid;
  }
}
