// Pictures that take the server a while: those in sight alone, one after the other, so that nothing else waits for them.

export class LazyPictures {
  constructor() {
    this.waiting = new Set();
    this.loading = false;
    this.seen = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        if (isIntersecting) this.waiting.add(target);
        else this.waiting.delete(target);
      }
      this.next();
    }, { rootMargin: "200px" });
  }

  /** Load a picture's data-src when it comes into sight. */
  add(image) { this.seen.observe(image); }

  next() {
    const [image] = this.waiting;
    if (this.loading || !image) return;
    this.loading = true;
    this.waiting.delete(image);
    this.seen.unobserve(image);
    const done = () => { this.loading = false; this.next(); };
    image.addEventListener("load", done, { once: true });
    image.addEventListener("error", done, { once: true });
    image.src = image.dataset.src;
  }
}
