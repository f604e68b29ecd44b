// The project's look in WebGL: what aerialdojo_gen/rendering/shading.py does, without its shade under things and its mirrors.
import * as THREE from "three";

const LIGHT = /* glsl */ `
  uniform vec3 sun, horizon, sunRgb, skyRgb, groundRgb;
  uniform float hazeM;
  uniform sampler2D shadowMap;
  uniform mat4 shadowMatrix;
  uniform float shadowBias, shadowSize, shadowOn;
  float sunlit(vec3 p) {
    vec3 s = (shadowMatrix * vec4(p, 1.0)).xyz * 0.5 + 0.5;
    if (shadowOn < 0.5 || any(lessThan(s.xy, vec2(0.0))) || any(greaterThan(s.xy, vec2(1.0)))) return 1.0;
    vec2 texel = s.xy * shadowSize - 0.5, f = fract(texel);
    ivec2 i = ivec2(floor(texel));
    vec4 lit = step(s.z, vec4(
      texelFetch(shadowMap, i, 0).r, texelFetch(shadowMap, i + ivec2(1, 0), 0).r,
      texelFetch(shadowMap, i + ivec2(0, 1), 0).r, texelFetch(shadowMap, i + ivec2(1, 1), 0).r));
    return mix(mix(lit.x, lit.y, f.x), mix(lit.z, lit.w, f.x), f.y);
  }
  vec3 shade(vec3 base, vec3 rel) {
    vec3 n = normalize(cross(dFdx(rel), dFdy(rel)));
    float lit = max(0.0, dot(n, sun));
    if (lit > 0.0) lit *= sunlit(cameraPosition + rel + n * shadowBias);
    float side = 1.0 + 0.16 * dot(n.xy, sun.xy) / (length(sun.xy) + 1e-9);
    vec3 light = base * base * (mix(groundRgb, skyRgb, 0.5 + 0.5 * n.z) * side + sunRgb * lit);
    light = light / (light + 0.155) * 1.019;
    light = mix(vec3(dot(light, vec3(0.3, 0.6, 0.1))), light, 0.85);
    #ifdef UNLIT
      light = base;
    #endif
    float range = dot(rel, rel), haze = range / (range + hazeM * hazeM);
    #ifdef BEYOND
      haze = max(haze, smoothstep(800.0, 1600.0, sqrt(range)));
    #endif
    return mix(light, horizon, haze);
  }`;

const VERTEX = /* glsl */ `
  #ifdef TEXTURED
    in vec3 uvl;
    out vec3 vUvl;
  #else
    in vec4 colour;
    out vec3 vColour;
  #endif
  out vec3 rel;
  void main() {
    rel = position - cameraPosition;
    #ifdef TEXTURED
      vUvl = uvl;
    #else
      vColour = colour.rgb;
    #endif
    gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
    #ifdef BEHIND
      gl_Position.z = gl_Position.w * 0.999999;
    #endif
  }`;

const FRAGMENT = /* glsl */ `
  precision highp sampler2DArray;
  in vec3 rel;
  #ifdef TEXTURED
    in vec3 vUvl;
    uniform sampler2DArray layers;
  #else
    in vec3 vColour;
  #endif
  out vec4 pixel;
  ${LIGHT}
  void main() {
    #ifdef TEXTURED
      vec4 texel = texture(layers, vec3(vUvl.xy, floor(vUvl.z + 0.5)));
      vec3 base = texel.rgb;
      #ifdef HOLES
        if (texel.a < 0.4) discard;
      #endif
    #else
      vec3 base = vColour;
    #endif
    #ifdef BEHIND
      pixel = vec4(base, 1.0);
    #else
      pixel = vec4(min(shade(base, rel), vec3(1.0)), 1.0);
    #endif
  }`;

/** What all materials of a scene share; the shadow map is filled in by castShadow. */
export function lightUniforms(payload) {
  return {
    sun: { value: new THREE.Vector3(...payload.sun) },
    horizon: { value: new THREE.Vector3(...payload.horizon) },
    sunRgb: { value: new THREE.Vector3(...payload.sun_rgb) },
    skyRgb: { value: new THREE.Vector3(...payload.sky_rgb) },
    groundRgb: { value: new THREE.Vector3(...payload.ground_rgb) },
    hazeM: { value: payload.haze_m },
    shadowMap: { value: null },
    shadowMatrix: { value: new THREE.Matrix4() },
    shadowBias: { value: 0.05 },
    shadowSize: { value: 1 },
    shadowOn: { value: 0 },
  };
}

/** Material and geometry of one group of the payload. */
export function groupMesh(group, uniforms, anisotropy) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(group.position, 3));
  geometry.setIndex(new THREE.BufferAttribute(group.index, 1));
  const own = { ...uniforms };
  if (group.uv) {
    geometry.setAttribute("uvl", new THREE.BufferAttribute(group.uv, 3));
    const [height, width] = group.size;
    const layers = new THREE.DataArrayTexture(group.texels, width, height, group.texels.length / (4 * width * height));
    layers.wrapS = layers.wrapT = THREE.RepeatWrapping;
    layers.magFilter = THREE.LinearFilter;
    layers.minFilter = THREE.LinearMipmapLinearFilter;
    layers.generateMipmaps = true;
    layers.anisotropy = anisotropy;
    layers.needsUpdate = true;
    own.layers = { value: layers };
  } else {
    geometry.setAttribute("colour", new THREE.BufferAttribute(group.colour, 4, true));
  }
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: own,
    defines: {
      ...(group.uv && { TEXTURED: 1 }), ...(group.holes && { HOLES: 1 }), ...(group.unlit && { UNLIT: 1 }),
      ...(group.behind && { BEHIND: 1 }), ...(group.beyond && { BEYOND: 1 }),
    },
    side: group.bothSides || group.behind ? THREE.DoubleSide : THREE.FrontSide,
  });
  const mesh = new THREE.Mesh(geometry, material);
  if (group.behind) mesh.frustumCulled = false;
  mesh.userData.shades = !group.behind && !group.beyond;
  mesh.matrixAutoUpdate = false;
  return mesh;
}

export function skyMesh(payload) {
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3, side: THREE.BackSide, depthWrite: false, depthTest: false,
    uniforms: { zenith: { value: new THREE.Vector3(...payload.zenith) },
      horizon: { value: new THREE.Vector3(...payload.horizon) } },
    vertexShader: `out vec3 dir; void main() { dir = position;
      gl_Position = projectionMatrix * vec4(mat3(viewMatrix) * position, 1.0); }`,
    fragmentShader: `in vec3 dir; uniform vec3 zenith, horizon; out vec4 pixel; void main() {
      pixel = vec4(mix(horizon, zenith, sqrt(max(0.0, normalize(dir).z))), 1.0); }`,
  });
  const sky = new THREE.Mesh(new THREE.IcosahedronGeometry(100, 3), material);
  sky.frustumCulled = false;
  sky.renderOrder = -1;
  return sky;
}

/** Render the sun's depth map once: nothing in the scene moves. */
export function castShadow(renderer, meshes, uniforms, low, high, size) {
  size = Math.min(size, renderer.capabilities.maxTextureSize);
  const centre = low.clone().add(high).multiplyScalar(0.5);
  const radius = high.clone().sub(low).length() / 2 + 1;
  const camera = new THREE.OrthographicCamera(-radius, radius, radius, -radius, 1, 3 * radius);
  camera.up.set(0, 0, 1);
  camera.position.copy(centre).addScaledVector(uniforms.sun.value, 2 * radius - 1);
  camera.lookAt(centre);
  camera.updateMatrixWorld(true);
  // Of colours there are none: the fewest bytes that a target may have.
  const target = new THREE.WebGLRenderTarget(size, size, {
    format: THREE.RedFormat, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter,
    depthTexture: new THREE.DepthTexture(size, size, THREE.FloatType),
  });
  const scene = new THREE.Scene();
  const black = new Map([THREE.FrontSide, THREE.DoubleSide].map((side) => [
    side, new THREE.MeshBasicMaterial({ color: 0, side })]));
  for (const mesh of meshes) {
    if (mesh.userData.shades) scene.add(new THREE.Mesh(mesh.geometry, black.get(mesh.material.side)));
  }
  renderer.setRenderTarget(target);
  renderer.clear();
  renderer.render(scene, camera);
  renderer.setRenderTarget(null);
  uniforms.shadowMap.value = target.depthTexture;
  uniforms.shadowMatrix.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
  uniforms.shadowBias.value = 0.03 + 1.5 * (2 * radius / size);
  uniforms.shadowSize.value = size;
  uniforms.shadowOn.value = 1;
}
