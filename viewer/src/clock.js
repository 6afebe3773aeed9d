// The time that everything in a player shows; it runs while playing and turns back at the end of its loop.

/** The moment `time_s` after a scene's epoch, such as "2024-05-01 16:59:58.02 UTC"; without a day if it is not known. */
export function momentText({ ms, dated, zone }, time_s) {
  const iso = new Date(10 * Math.round((ms + 1000 * time_s) / 10)).toISOString();
  return `${dated ? `${iso.slice(0, 10)} ` : ""}${iso.slice(11, 22)} ${zone}`;
}

export class Clock {
  constructor(start_s, end_s, told) {
    this.whole = { start_s, end_s };
    this.loop = null;
    this.time_s = start_s;
    this.speed = 1;
    this.playing = false;
    this.told = told;
    this.before = null;
    /** What gives the next time while it plays, such as a video: (time_s, speed) -> s, or null. */
    this.leader = () => null;
  }

  get range() {
    return this.loop ?? this.whole;
  }

  seek(time_s) {
    if (!Number.isFinite(time_s)) return;
    this.time_s = Math.min(Math.max(time_s, this.whole.start_s), this.whole.end_s);
    this.told();
  }

  setLoop(span) {
    this.loop = span && { start_s: Math.max(span.start_s, this.whole.start_s), end_s: Math.min(span.end_s, this.whole.end_s), label: span.label };
    if (this.loop && (this.time_s < this.loop.start_s || this.time_s > this.loop.end_s)) this.seek(this.loop.start_s);
    else this.told();
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    this.before = null;
    if (this.time_s >= this.range.end_s) this.time_s = this.range.start_s;
    const frame = (now) => {
      if (!this.playing) return;
      const step = this.before === null ? 0 : (now - this.before) / 1000;
      this.before = now;
      const led = this.leader(this.time_s, this.speed);
      this.advance(led === null ? Math.min(step, 0.25) * this.speed : led - this.time_s);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.told();
  }

  pause() {
    this.playing = false;
    this.told();
  }

  /** Time passes; the whole is played once, a loop again and again. */
  advance(by_s) {
    const { start_s, end_s } = this.range;
    let next = this.time_s + by_s;
    if (next >= end_s) {
      if (this.loop) next = start_s + ((next - start_s) % (end_s - start_s));
      else {
        next = end_s;
        this.playing = false;
      }
    }
    this.seek(next);
  }
}
