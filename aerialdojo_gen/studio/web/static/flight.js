// Flying along a route: play, pause and speed, with the poses in between.

// At speed 1: metres and radians a second, and the least that an action takes, so that a turn is seen as one.
const PACE_M_S = 3, PACE_RAD_S = Math.PI / 3, LEAST_S = 0.1;
export const SPEEDS = [0.5, 1, 2, 4, 8];
const turned = (from, to) => Math.atan2(Math.sin(to - from), Math.cos(to - from));

/** Seconds at which each pose is reached. */
export function timesOf(poses) {
  const times = [0];
  for (let k = 1; k < poses.length; k++) {
    const a = poses[k - 1], b = poses[k];
    const metres = Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    times.push(times[k - 1] + Math.max(LEAST_S, metres / PACE_M_S, Math.abs(turned(a[3], b[3])) / PACE_RAD_S));
  }
  return times;
}

export class Flight {
  /** show(pose [x, y, z, yaw], number of the last pose passed) draws it; state(playing) is told when that changes. */
  constructor(poses, { show, state }) {
    Object.assign(this, { poses, show, state, times: timesOf(poses), time: 0, speed: 1, playing: false, frame: 0 });
  }

  get end() { return this.times.at(-1); }

  /** The pose at a time: between two poses on the straight line, turned the shorter way. */
  poseAt(time) {
    const { poses, times } = this;
    let k = 0;
    while (k + 1 < poses.length && times[k + 1] <= time) k++;
    if (k + 1 >= poses.length) return [poses[k], k];
    const a = poses[k], b = poses[k + 1], share = (time - times[k]) / (times[k + 1] - times[k]);
    return [[...[0, 1, 2].map((j) => a[j] + share * (b[j] - a[j])), a[3] + share * turned(a[3], b[3])], k];
  }

  now() { this.show(...this.poseAt(this.time)); }

  /** Go to a pose by its number. */
  seek(k) {
    this.time = this.times[k];
    this.now();
  }

  play() {
    if (this.playing) return;
    if (this.time >= this.end) this.time = 0;
    this.set(true);
    let last = performance.now();
    const tick = (now) => {
      // A frame that came late does not leap: nobody would see what lies between.
      this.time = Math.min(this.end, this.time + this.speed * Math.min(0.25, Math.max(0, now - last) / 1000));
      last = now;
      this.now();
      if (this.time >= this.end) this.pause();
      else this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
  }

  pause() {
    cancelAnimationFrame(this.frame);
    if (this.playing) this.set(false);
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  set(playing) {
    this.playing = playing;
    this.state(playing);
  }
}
