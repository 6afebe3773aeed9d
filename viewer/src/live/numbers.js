// Numbers as words: few digits, a true minus sign, and a dash where there is none.

export function decimals(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const text = value.toFixed(digits ?? (size >= 100 ? 0 : size >= 1 ? 1 : 2));
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

export const angleUnit = (unit) => (unit === "deg" ? "°" : ` ${unit}`);

export function ago(seconds) {
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}
