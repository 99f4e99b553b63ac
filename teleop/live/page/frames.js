// Loop of animation frames, which calls each drawing function in every frame or in every n-th frame.

const WINDOW = 120; // number of frames over which the frame rate is computed

export class Frames {
  constructor() {
    this.drawings = [];
    this.frame = 0;
    this.times = new Float64Array(WINDOW);
    requestAnimationFrame((now) => this.#run(now));
  }

  // Call `draw` in every n-th frame, where n is `every`. Functions with the same `every` and different `phase` are
  // called in different frames, so that no frame takes too long.
  add(draw, every = 1, phase = 0) {
    this.drawings.push({ draw, every, phase });
  }

  get rate() {
    const n = Math.min(this.frame, WINDOW) - 1;
    const last = this.times[(this.frame - 1) % WINDOW];
    const first = this.times[(this.frame - 1 - n) % WINDOW];
    return n > 0 ? (1000 * n) / (last - first) : NaN;
  }

  #run(now) {
    requestAnimationFrame((next) => this.#run(next));
    this.times[this.frame % WINDOW] = now;
    this.frame += 1;
    for (const { draw, every, phase } of this.drawings) {
      if (this.frame % every === phase % every) draw(now, this.frame);
    }
  }
}
