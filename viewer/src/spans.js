// Spans of time: which one is played in a loop, and where a ghost is while the figure is at a time.

/** The span that holds a time, or null. */
export function spanAt(spans, time_s) {
  return spans.find((span) => time_s >= span.start_s && time_s < span.end_s) ?? null;
}

/**
 * The ghost's time while the figure is at `time_s`; null where there is none.
 * By time both spans begin together; by phase they end together too. Without spans the recordings begin together.
 */
export function ghostTime(time_s, span, ghostSpan, align, starts) {
  if (!ghostSpan) return time_s - starts.own_s + starts.ghost_s;
  const from = span ?? { start_s: starts.own_s, end_s: starts.own_s + ghostSpan.end_s - ghostSpan.start_s };
  const gone = time_s - from.start_s;
  const scale = align === "phase" ? (ghostSpan.end_s - ghostSpan.start_s) / (from.end_s - from.start_s) : 1;
  const at = ghostSpan.start_s + scale * gone;
  return at >= ghostSpan.start_s && at <= ghostSpan.end_s ? at : null;
}
