// Tones: after each stroke, high within all targets, low outside of one; and those of the guided start.

const TONES_HZ = { true: 880, false: 220 };
const LENGTH_S = 0.18;

export class Sound {
  constructor() {
    this.isOn = false;
  }

  /** Browsers allow sound after a key or a click only: call it from there. */
  turn(isOn) {
    this.isOn = isOn;
    if (isOn) this.context ??= new AudioContext();
    this.context?.resume();
  }

  play(isWithin) {
    this.tone(TONES_HZ[isWithin]);
  }

  tone(hz) {
    if (!this.isOn) return;
    const { context } = this;
    const [tone, volume] = [context.createOscillator(), context.createGain()];
    tone.frequency.value = hz;
    volume.gain.setValueAtTime(0.25, context.currentTime);
    volume.gain.exponentialRampToValueAtTime(0.001, context.currentTime + LENGTH_S);
    tone.connect(volume).connect(context.destination);
    tone.start();
    tone.stop(context.currentTime + LENGTH_S);
  }
}
