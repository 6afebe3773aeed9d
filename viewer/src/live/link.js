// The WebSocket to the session: tries again after a loss, and knows the session's clock.

const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 8;
/** The fastest message of the last one or two such spans gives the difference of the clocks. */
const CLOCK_SPAN_S = 10;
const NO_ANSWER_S = 5;

/** Now by this browser's steady clock, s. */
export const now_s = () => performance.now() / 1000;

export class Link {
  /** `heard(message, arrived_s)` gets each message, `changed(state)` "open", "waiting" or "trying". */
  constructor(address, heard, changed) {
    Object.assign(this, { address, heard, changed, failures: 0, state: "trying", lost_s: null, retry_s: null });
    this.offsets = { now: Infinity, before: Infinity, since_s: now_s() };
    addEventListener("online", () => this.retryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this.retryNow());
    this.connect();
  }

  connect() {
    this.become("trying");
    this.socket = new WebSocket(this.address);
    const slow = setTimeout(() => this.socket.close(), 1000 * NO_ANSWER_S);
    this.socket.onopen = () => clearTimeout(slow);
    this.socket.onmessage = (event) => {
      const arrived_s = now_s();
      const message = JSON.parse(event.data);
      if (message.type === "hello") this.opened();
      if (Number.isFinite(message.sent_s)) this.compare(arrived_s, message.sent_s);
      this.heard(message, arrived_s);
    };
    this.socket.onclose = () => {
      clearTimeout(slow);
      this.wait();
    };
  }

  opened() {
    this.failures = 0;
    this.lost_s = null;
    this.offsets = { now: Infinity, before: Infinity, since_s: now_s() };
    this.become("open");
  }

  wait() {
    this.lost_s ??= now_s();
    // a fifth at random, so that many viewers do not come back at the same moment
    const wait_s = Math.min(LONGEST_WAIT_S, FIRST_WAIT_S * 2 ** this.failures) * (0.8 + 0.4 * Math.random());
    this.failures += 1;
    this.retry_s = now_s() + wait_s;
    this.timer = setTimeout(() => this.connect(), 1000 * wait_s);
    this.become("waiting");
  }

  retryNow() {
    if (this.state !== "waiting") return;
    clearTimeout(this.timer);
    this.connect();
  }

  become(state) {
    this.state = state;
    this.changed(state);
  }

  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  compare(arrived_s, sent_s) {
    const { offsets } = this;
    if (arrived_s - offsets.since_s > CLOCK_SPAN_S) Object.assign(offsets, { before: offsets.now, now: Infinity, since_s: arrived_s });
    offsets.now = Math.min(offsets.now, arrived_s - sent_s);
  }

  /** A time of this browser's clock by the session's, s. */
  sessionTime(at_s = now_s()) {
    return at_s - Math.min(this.offsets.now, this.offsets.before);
  }
}
