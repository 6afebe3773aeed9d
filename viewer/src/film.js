// A video beside the figure: a local file under the player's time, with the skeleton over it where the camera is known.

import { button, element } from "./dom.js";
import { coloured } from "./palette.js";

/** While it plays, a picture this far off is left alone: the video's own clock is the smoother one. */
const LOOSE_S = 0.25;
/** A time on the edge of two pictures shows the later one. */
const INSIDE_S = 1e-3;
const CANNOT = "The browser cannot show this file. Choose the video below, or convert it to MP4 (H.264) or WebM.";
const ABSENT = "The video has no picture at this time.";

export class Film {
  /** `film` is the scene's video; `figure` gives the places that are drawn over it. */
  constructor(film, figure, player) {
    Object.assign(this, { film, figure, player, offset_s: film.offset_s, failed: false, overlaid: Boolean(film.camera) });
    this.rate = 1 + 1e-6 * film.drift_ppm;
    this.video = element("video", { src: film.src, playsinline: true, preload: "auto", "aria-label": `Video ${film.name}` });
    this.video.muted = true;
    this.overlay = element("canvas", { class: "op-overlay", "aria-hidden": "true" });
    this.words = element("p", { class: "op-note", role: "status", hidden: true });
    this.picture = element("div", { class: "op-video" }, this.video, this.overlay);
    this.root = element("div", { class: "op-film" }, this.picture, this.words, this.makeTools());
    this.shownAt_s = null;
    for (const event of ["loadedmetadata", "seeked"]) this.video.addEventListener(event, () => this.refresh());
    this.video.addEventListener("loadedmetadata", () => this.ready());
    this.video.addEventListener("error", () => this.fails());
    this.watchPictures();
    new ResizeObserver(() => this.drawOverlay()).observe(this.picture);
  }

  makeTools() {
    const { film, player } = this;
    const id = `${player.root.id}-film`;
    const step_s = Number(film.frame_s.toFixed(4));
    this.number = element("input", { type: "number", id: `${id}-offset`, step: "any", value: film.offset_s.toFixed(3), on: { change: () => this.setOffset(Number(this.number.value)) } });
    const nudge = (sign, words) => button(words, () => this.setOffset(this.offset_s + sign * step_s), { label: `Video one picture ${sign < 0 ? "later" : "earlier"}` });
    const offset = element("div", { class: "op-field" }, element("label", { for: this.number.id, text: "Offset, s" }), nudge(-1, "−"), this.number, nudge(1, "+"));
    this.box = element("input", { type: "checkbox", id: `${id}-skeleton`, checked: this.overlaid, on: { change: () => this.showSkeleton(this.box.checked) } });
    const skeleton = film.camera && element("div", { class: "op-check" }, this.box, element("label", { for: this.box.id, text: "Skeleton" }));
    this.sound = element("input", { type: "checkbox", id: `${id}-sound`, on: { change: () => (this.video.muted = !this.sound.checked) } });
    const sound = film.sound && element("div", { class: "op-check" }, this.sound, element("label", { for: this.sound.id, text: "Sound" }));
    this.file = element("input", { type: "file", accept: "video/*", id: `${id}-file`, on: { change: () => this.choose(this.file.files[0]) } });
    const file = element("div", { class: "op-field op-file" }, element("label", { for: this.file.id, text: "Other file" }), this.file);
    return element("div", { class: "op-tools" }, offset, skeleton, sound, file);
  }

  choose(file) {
    if (!file) return;
    if (this.url) URL.revokeObjectURL(this.url);
    this.url = URL.createObjectURL(file);
    this.failed = false;
    this.video.src = this.url;
  }

  setOffset(offset_s) {
    if (!Number.isFinite(offset_s)) return;
    this.offset_s = offset_s;
    this.number.value = offset_s.toFixed(3);
    this.refresh();
  }

  showSkeleton(shown) {
    this.overlaid = shown;
    this.drawOverlay();
  }

  fails() {
    this.failed = true;
    this.say(CANNOT);
  }

  say(text) {
    this.words.textContent = text;
    this.words.hidden = !text;
  }

  ready() {
    const { videoWidth, videoHeight } = this.video;
    if (!videoWidth) return;
    // the skeleton fits only if the box has the picture's shape, at any height
    this.picture.style.aspectRatio = `${videoWidth} / ${videoHeight}`;
    this.picture.style.maxWidth = `calc(75vh * ${videoWidth / videoHeight})`;
  }

  refresh() {
    this.showAt(this.player.time_s);
    this.drawOverlay();
  }

  /** Video time of a time of the track, s, and back. */
  videoTime(time_s) {
    return (time_s - this.offset_s) / this.rate;
  }

  trackTime(video_s) {
    return this.offset_s + this.rate * video_s;
  }

  covers(time_s) {
    const at = this.videoTime(time_s);
    return !this.failed && this.video.readyState > 0 && at >= 0 && at < this.video.duration;
  }

  /** Leads while it plays: the track's time of the video, s; null where it has no picture or still waits for one. */
  lead(time_s, speed) {
    const { video } = this;
    if (!this.covers(time_s)) return this.pause();
    if (Math.abs(this.videoTime(time_s) - video.currentTime) > LOOSE_S * Math.max(1, speed)) video.currentTime = this.videoTime(time_s) + INSIDE_S;
    video.playbackRate = speed / this.rate;
    if (video.paused) video.play().catch(() => {});
    // until it runs, the player's time stands still with it
    return video.seeking || video.readyState < 3 ? time_s : Math.max(time_s, this.trackTime(video.currentTime));
  }

  pause() {
    if (!this.video.paused) this.video.pause();
    return null;
  }

  /** Shows the picture of a time; a playing video goes on by itself. */
  showAt(time_s) {
    if (this.failed || !this.video.readyState) return;
    const there = this.covers(time_s);
    this.picture.classList.toggle("op-absent", !there);
    this.say(there ? "" : ABSENT);
    if (!this.player.clock.playing) this.pause();
    if (!this.video.paused || this.video.seeking) return;
    const wanted = Math.min(Math.max(this.videoTime(time_s) + INSIDE_S, 0), this.video.duration || 0);
    if (Math.abs(this.video.currentTime - wanted) > 0.5 * INSIDE_S) this.video.currentTime = wanted;
  }

  /** Where the browser says which picture it shows, the skeleton is that picture's, not the clock's. */
  watchPictures() {
    if (!this.video.requestVideoFrameCallback) {
      this.video.addEventListener("timeupdate", () => this.drawOverlay());
      return;
    }
    const shown = (_, { mediaTime }) => {
      this.shownAt_s = mediaTime;
      this.drawOverlay();
      this.video.requestVideoFrameCallback(shown);
    };
    this.video.requestVideoFrameCallback(shown);
  }

  get pictureTime_s() {
    return this.trackTime(this.shownAt_s ?? this.video.currentTime);
  }

  drawOverlay() {
    const { camera } = this.film;
    const { clientWidth, clientHeight } = this.picture;
    if (!camera || !clientWidth) return;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    this.overlay.width = Math.round(clientWidth * ratio);
    this.overlay.height = Math.round(clientHeight * ratio);
    const time_s = this.pictureTime_s;
    if (!this.overlaid || !this.covers(this.player.time_s) || time_s < this.figure.start_s || time_s > this.figure.end_s) return;
    const pen = this.overlay.getContext("2d");
    pen.scale((ratio * clientWidth) / camera.width_px, (ratio * clientHeight) / camera.height_px);
    const thick = (2.5 * camera.width_px) / clientWidth;
    const seen = this.pixelsAt(time_s);
    const lines = this.lines();
    for (const edge of [true, false]) {
      for (const { ends, width, colour } of lines) {
        const [one, other] = ends.map((k) => seen[k]);
        if (one && other) line(pen, one, other, (edge ? 2.2 : 1) * width * thick, edge ? "#000a" : colour);
      }
    }
  }

  /** What is measured in full width, what is only drawn, such as a rower's legs, in half of it. */
  lines() {
    const { bones, strands } = this.figure.scene;
    const drawn = strands.flatMap(({ points }) => points.slice(1).map((end, k) => ({ ends: [points[k], end], width: 0.5, colour: LIT.body })));
    return [...drawn, ...bones.map(({ ends, side }) => ({ ends, width: 1, colour: coloured(LIT, side) }))];
  }

  /** Pixels of the points of the figure in the calibrated picture; null behind the camera or where not known. */
  pixelsAt(time_s) {
    const places = this.figure.placesAt(time_s);
    return this.figure.points.map((_, k) => pixel(this.film.camera, [...places.slice(3 * k, 3 * k + 3)]));
  }
}

/** Bright on any picture; the dark palette's sides. */
const LIT = { right: "#56b4e9", left: "#f0884a", body: "#f4f6f8" };

function line(pen, a, b, width, colour) {
  Object.assign(pen, { lineWidth: width, strokeStyle: colour, lineCap: "round" });
  pen.beginPath();
  pen.moveTo(...a);
  pen.lineTo(...b);
  pen.stroke();
}

/** OpenCV's pinhole and lens (Brown 1971), as in oarlock.movement.video.camera. */
export function pixel(camera, place) {
  const [x0, y0, z0] = camera.camera_from_root.map((row, k) => row[0] * place[0] + row[1] * place[1] + row[2] * place[2] + camera.root_in_camera_m[k]);
  if (!(z0 > 1e-6)) return null;
  const [x, y] = [x0 / z0, y0 / z0];
  const [k1, k2, p1, p2, k3] = camera.distortion;
  const r2 = x * x + y * y;
  const radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const right = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  const down = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  // the middle of the first pixel is 0, the canvas' edge half a pixel before it
  return [camera.focal_px[0] * right + camera.centre_px[0] + 0.5, camera.focal_px[1] * down + camera.centre_px[1] + 0.5];
}
