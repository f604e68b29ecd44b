// How much is drawn while something moves: as much as ten frames a second allow. At rest all of it is.

/** Pixels a pixel of the page, least size of a thing in pixels, most segments of a crowd; the first draws everything. */
export const LEVELS = [
  { ratio: 1, leastPixels: 0, mostSegments: Infinity }, { ratio: 1, leastPixels: 4, mostSegments: 150000 },
  { ratio: 0.75, leastPixels: 10, mostSegments: 100000 }, { ratio: 0.5, leastPixels: 16, mostSegments: 70000 },
  { ratio: 0.5, leastPixels: 32, mostSegments: 50000 }, { ratio: 0.4, leastPixels: 48, mostSegments: 30000 },
  { ratio: 0.3, leastPixels: 64, mostSegments: 15000 },
];
/** Where a browser without a GPU begins. */
export const SOFTWARE_LEVEL = 3;
// A frame that takes longer is followed by one of which less is drawn; some that take less, by one of more.
const SLOW_MS = 85, VERY_SLOW_MS = 220, QUICK_MS = 50, QUICK_FRAMES = 6, POLL_MS = 4;
// What was too slow is not tried again so soon: the picture would flicker between two sharpnesses.
const WARY_MS = 10000;
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/** Whether the browser draws without a GPU: what a context says of itself. */
export function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? String(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

export class Pace {
  constructor(gl, level) {
    this.gl = gl;
    this.level = level;
    this.quick = 0;
    this.slow = { level: -1, until: 0 };
    this.fence = null;
  }

  /** Whether a frame is still being drawn: another one would only wait behind it. */
  get busy() { return this.fence !== null; }

  /** Wait for what was just asked for; then(milliseconds) when it is drawn. */
  watch(then) {
    const { gl } = this, begun = performance.now();
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const poll = () => {
      if (this.fence && !gl.isContextLost() && gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) {
        setTimeout(poll, POLL_MS);
        return;
      }
      gl.deleteSync(this.fence);
      this.fence = null;
      then(performance.now() - begun);
    };
    setTimeout(poll, POLL_MS);
  }

  /** Draw less, or more, after a frame of a motion that took so long. */
  learn(milliseconds) {
    this.quick = milliseconds < QUICK_MS ? this.quick + 1 : 0;
    const now = performance.now();
    if (milliseconds > SLOW_MS) {
      this.slow = { level: this.level, until: now + WARY_MS };
      this.level = Math.min(LEVELS.length - 1, this.level + (milliseconds > VERY_SLOW_MS ? 2 : 1));
    } else if (this.quick >= QUICK_FRAMES && this.level > 0 && (this.level - 1 > this.slow.level || now > this.slow.until)) {
      this.level -= 1;
      this.quick = 0;
    }
  }
}
