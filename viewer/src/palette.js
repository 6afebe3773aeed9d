// Colours: Okabe and Ito's palette, safe for colour-blind readers. Right and left differ in lightness too.

const LIGHT = {
  right: "#0072b2",
  left: "#d55e00",
  body: "#8793a0",
  skin: "#aeb6bf",
  tool: "#7a6a4f",
  frame: "#9aa4ae",
  seat: "#4b545e",
  shell: "#d9dde2",
  loop: "#9a3d7c",
  ghost: "#7b4fb5",
  spread: "#009e73",
  ground: "#dfe3e7",
  grid: "#c3cbd3",
  water: "#a9cbe0",
  wave: "#8fb8d2",
  sky: "#fbfcfd",
  ink: "#16202b",
  soft: "#566270",
  rule: "#dde2e8",
};

const DARK = {
  ...LIGHT,
  right: "#56b4e9",
  left: "#f0884a",
  body: "#9aa6b2",
  skin: "#66727e",
  tool: "#b9a583",
  frame: "#75818d",
  seat: "#aab4be",
  shell: "#8d99a5",
  loop: "#e3a3c8",
  ghost: "#b99ae6",
  spread: "#2fc79b",
  ground: "#1d242c",
  grid: "#313b46",
  water: "#16303f",
  wave: "#26485b",
  sky: "#12171d",
  ink: "#e8edf2",
  soft: "#a3afbb",
  rule: "#313b46",
};

export const darkened = () => !matchMedia("print").matches && matchMedia("(prefers-color-scheme: dark)").matches;

export const palette = (dark = darkened()) => (dark ? DARK : LIGHT);

/** Colour of what has a side, else of a part. */
export const coloured = (colours, side, part = "body") => (side === "right" || side === "left" ? colours[side] : colours[part] ?? colours.body);
