-- Questions to a season, as table macros of DuckDB. `database.py` has made the views `strokes`, `recordings`, `runs` and
-- `athletes` before, the macro `stroke_values`, and the functions `pooled`, `t95` and `t999`. Nothing here brings runs of
-- two classes (`comparable`) together.
--
-- Uncertainty. A stroke counts by 1 / (own variance of the session's strokes + its measured variance). A session counts by
-- 1 / (its variance + the variance between sessions): `pooled`. So a band covers what differs from session to session, errors
-- of a calibration too, if they differ from session to session.

CREATE MACRO weight(variance) AS 1.0 / greatest(variance, 1e-24);

-- Each stroke with its weight inside its session.
CREATE MACRO weighted_values(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH v AS (SELECT * FROM stroke_values(metric, rate_from := rate_from, rate_to := rate_to) WHERE value IS NOT NULL),
spread AS (
    SELECT recording, max(stroke) AS last_stroke, coalesce(avg(std * std), 0.0) AS noise2,
        greatest(coalesce(var_samp(value), 0.0) - coalesce(avg(std * std), 0.0), 0.0) AS own2
    FROM v GROUP BY recording
)
SELECT v.*, last_stroke, weight(own2 + coalesce(std * std, noise2)) AS w FROM v JOIN spread USING (recording);

-- One row a recording: weighted mean with its standard error, scatter of strokes, and how the number goes with the rate.
CREATE MACRO sessions(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH g AS (
    SELECT recording, count(*) AS n, sum(w) AS w1, sum(w * w) AS w2, sum(w * value) AS wx, sum(w * w * value) AS wwx,
        sum(w * w * value * value) AS wwxx, sum(value) AS x, sum(value * value) AS xx, sum(std * std) AS ss,
        count(std) AS stds, count(rate) AS rates, sum(rate) AS r, sum(rate * rate) AS rr, sum(rate * value) AS rx,
        sum(value) FILTER (rate IS NOT NULL) AS x_with_rate
    FROM weighted_values(metric, rate_from := rate_from, rate_to := rate_to) GROUP BY recording HAVING count(*) >= 10
)
SELECT recording, coalesce(file, device) AS source, comparable, athlete, boat, rig, started, month, n AS strokes,
    wx / w1 AS mean,
    sqrt(greatest(wwxx * w1 * w1 - 2.0 * wx * w1 * wwx + wx * wx * w2, 0.0) * n / (n - 1)) / (w1 * w1) AS se,
    sqrt(greatest(xx - x * x / n, 0.0) / (n - 1)) AS sd, sqrt(ss / nullif(stds, 0)) AS noise, r / nullif(rates, 0) AS rate,
    rx - r * x_with_rate / nullif(rates, 0) AS with_rate, rr - r * r / nullif(rates, 0) AS rate_spread
FROM g JOIN recordings USING (recording);

-- The same with `level`: the mean as it would be at the athlete's usual rate, by the slope inside of sessions; the rate
-- itself stays as it is.
CREATE MACRO levels(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH s AS (FROM sessions(metric, rate_from := rate_from, rate_to := rate_to))
SELECT *, mean - CASE WHEN metric = 'rate_per_min' THEN 0.0 ELSE coalesce(per_rate * (rate - usual_rate), 0.0) END AS level
FROM (
    SELECT *, sum(with_rate) OVER own / nullif(sum(rate_spread) OVER own, 0.0) AS per_rate,
        sum(strokes * rate) OVER own / sum(strokes) OVER own AS usual_rate
    FROM s WINDOW own AS (PARTITION BY athlete, comparable)
);

-- One row a month of an athlete. The variance between sessions is that inside of months, of all months together.
CREATE MACRO trend(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH l AS (
    SELECT *, level - avg(level) OVER (PARTITION BY athlete, comparable, month) AS off
    FROM levels(metric, rate_from := rate_from, rate_to := rate_to)
),
between_sessions AS (
    SELECT athlete, comparable, count(*) - count(DISTINCT month) AS df,
        greatest(sum(off * off) / nullif(count(*) - count(DISTINCT month), 0) - avg(se * se), 0.0) AS tau2
    FROM l GROUP BY athlete, comparable
),
m AS (
    SELECT athlete, comparable, month, count(*) AS sessions, sum(strokes)::BIGINT AS strokes, avg(rate) AS rate,
        sum(epoch(started) * w) / sum(w) AS at_s, sum(level * w) / sum(w) AS mean, 1.0 / sqrt(sum(w)) AS se,
        any_value(df) AS df
    FROM (SELECT *, weight(tau2 + se * se) AS w FROM l JOIN between_sessions USING (athlete, comparable))
    GROUP BY athlete, comparable, month
)
SELECT athlete, comparable, month, sessions, strokes, rate, mean, mean - t95(df) * se AS low, mean + t95(df) * se AS high,
    se, at_s
FROM m ORDER BY athlete, comparable, month;

-- One row an athlete: change a month over the time asked for; NULL with fewer than 4 months. Its unit is the month: what
-- sessions of a month have in common counts once. `changed`: the 99.9 % band is beside zero, so that among 60 athletes a
-- false one is rare. A change that float32, in which strokes are stored, does not resolve is 0.
CREATE MACRO changes(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH m AS (
    SELECT *, at_s / 2629800.0 AS x FROM trend(metric, rate_from := rate_from, rate_to := rate_to) WHERE at_s IS NOT NULL
),
plain AS (
    SELECT athlete, comparable, greatest(
        (regr_syy(mean, x) - regr_sxy(mean, x) * regr_sxy(mean, x) / nullif(regr_sxx(mean, x), 0.0))
        / nullif(count(*) - 2, 0) - avg(se * se), 0.0) AS theta2
    FROM m GROUP BY athlete, comparable
),
c AS (
    SELECT *, x - sum(w * x) OVER own / sum(w) OVER own AS dx, mean - sum(w * mean) OVER own / sum(w) OVER own AS dy
    FROM (SELECT *, weight(se * se + coalesce(theta2, 0.0)) AS w FROM m JOIN plain USING (athlete, comparable))
    WINDOW own AS (PARTITION BY athlete, comparable)
),
line AS (
    SELECT athlete, comparable, count(*) AS months, sum(sessions)::BIGINT AS sessions, sum(strokes)::BIGINT AS strokes,
        min(month) AS first_month, max(month) AS last_month, max(x) - min(x) AS span, max(abs(mean)) AS size,
        sum(w * dx * dy) / nullif(sum(w * dx * dx), 0.0) AS slope, sum(w * dx * dx) AS sxx,
        sum(w * dy * dy) - sum(w * dx * dy) * sum(w * dx * dy) / nullif(sum(w * dx * dx), 0.0) AS rss, count(*) - 2 AS df
    FROM c GROUP BY athlete, comparable
),
e AS (
    SELECT *, CASE WHEN df >= 2 THEN sqrt(greatest(rss, 0.0) / df / sxx) END AS se,
        CASE WHEN df >= 2 THEN if(abs(slope * span) < size * 1.2e-7, 0.0, slope) END AS per_month
    FROM line
)
SELECT athlete, comparable, months, sessions, strokes, first_month, last_month, per_month, per_month - t95(df) * se AS low,
    per_month + t95(df) * se AS high, se, per_month * span AS change, abs(per_month) > t999(df) * se AS changed
FROM e ORDER BY changed DESC NULLS LAST, abs(per_month) / nullif(se, 0.0) DESC NULLS LAST, athlete;

-- One row a recording: mean of the last third of its strokes minus that of the first, at equal rate.
CREATE MACRO session_drifts(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH t AS (
    SELECT recording, (stroke - 1) * 3 // last_stroke AS third, count(*) AS n, sum(w * value) / sum(w) AS mean,
        sqrt(1.0 / sum(w)) AS se, avg(rate) AS rate,
        sum(rate * value) - sum(rate) * avg(value) FILTER (rate IS NOT NULL) AS with_rate,
        sum(rate * rate) - sum(rate) * avg(rate) AS rate_spread
    FROM weighted_values(metric, rate_from := rate_from, rate_to := rate_to) GROUP BY ALL
),
r AS (
    SELECT athlete, comparable,
        if(metric = 'rate_per_min', 0.0, sum(with_rate) / nullif(sum(rate_spread), 0.0)) AS per_rate
    FROM t JOIN recordings USING (recording) GROUP BY athlete, comparable
)
SELECT b.recording, coalesce(k.file, k.device) AS source, k.comparable, k.athlete, k.started, a.n + b.n AS strokes,
    a.mean AS first, b.mean AS last, b.mean - a.mean - coalesce(per_rate * (b.rate - a.rate), 0.0) AS drift,
    sqrt(a.se * a.se + b.se * b.se) AS se
FROM t b JOIN t a ON a.recording = b.recording AND a.third = 0 AND b.third = 2 AND least(a.n, b.n) >= 10
JOIN recordings k ON k.recording = b.recording
JOIN r ON r.athlete = k.athlete AND r.comparable = k.comparable;

-- One row an athlete: drift within a session, mean of its sessions.
CREATE MACRO drift(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH p AS (
    SELECT athlete, comparable, count(*) AS sessions, sum(strokes)::BIGINT AS strokes,
        unnest(pooled(list(drift), list(se)))
    FROM session_drifts(metric, rate_from := rate_from, rate_to := rate_to) GROUP BY athlete, comparable
)
SELECT athlete, comparable, sessions, strokes, mean, mean - t95(sessions - 1) * se AS low,
    mean + t95(sessions - 1) * se AS high, se, abs(mean) > t999(sessions - 1) * se AS changed
FROM p ORDER BY changed DESC NULLS LAST, abs(mean) / se DESC NULLS LAST, athlete;

-- One row a recording and class of rate, its middle +- 1/min: a piece has 10 strokes or more at that rate.
CREATE MACRO pieces(metric, rate_from := NULL, rate_to := NULL) AS TABLE
SELECT recording, athlete, comparable, round(rate / 2.0) * 2.0 AS rate_class, count(*) AS strokes,
    sum(w * value) / sum(w) AS mean, sqrt(1.0 / sum(w)) AS se, stddev_samp(value) AS sd, avg(std * std) AS noise2
FROM weighted_values(metric, rate_from := rate_from, rate_to := rate_to) WHERE rate IS NOT NULL
GROUP BY ALL HAVING count(*) >= 10;

-- One row an athlete and class of rate: standard deviation of strokes within a piece; the band is of its geometric mean.
-- `noise` is what the measurement adds to it.
CREATE MACRO consistency(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH g AS (
    SELECT athlete, comparable, rate_class, count(*) AS pieces, sum(strokes)::BIGINT AS strokes, avg(ln(sd)) AS mean,
        stddev_samp(ln(sd)) / sqrt(count(*)) AS se, sqrt(avg(noise2)) AS noise
    FROM pieces(metric, rate_from := rate_from, rate_to := rate_to) WHERE sd > 0.0 GROUP BY ALL
)
SELECT athlete, comparable, rate_class, pieces, strokes, exp(mean) AS sd,
    exp(mean - t95(pieces - 1) * se) AS low, exp(mean + t95(pieces - 1) * se) AS high, noise
FROM g ORDER BY athlete, comparable, rate_class;

-- One row an athlete and class of rate: to compare athletes, or one athlete at several rates.
CREATE MACRO same_rate(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH g AS (
    SELECT athlete, comparable, rate_class, count(*) AS pieces, sum(strokes)::BIGINT AS strokes,
        unnest(pooled(list(mean), list(se)))
    FROM pieces(metric, rate_from := rate_from, rate_to := rate_to) GROUP BY athlete, comparable, rate_class
)
SELECT athlete, comparable, rate_class, pieces, strokes, mean,
    mean - t95(pieces - 1) * se AS low, mean + t95(pieces - 1) * se AS high, se
FROM g ORDER BY comparable, rate_class, athlete;

-- One row an athlete: right minus left.
CREATE MACRO sides(metric, rate_from := NULL, rate_to := NULL) AS TABLE
WITH p AS (
    SELECT athlete, comparable, count(*) AS sessions, sum(strokes)::BIGINT AS strokes,
        unnest(pooled(list(mean), list(se)))
    FROM sessions(metric || ' right minus left', rate_from := rate_from, rate_to := rate_to)
    GROUP BY athlete, comparable
)
SELECT athlete, comparable, sessions, strokes, mean, mean - t95(sessions - 1) * se AS low,
    mean + t95(sessions - 1) * se AS high, se, abs(mean) > t999(sessions - 1) * se AS different
FROM p ORDER BY abs(mean) DESC, athlete;

-- One row an athlete and change of rig of the boat: mean of the sessions after it minus mean before, at equal rate, inside of
-- `days` before and after.
CREATE MACRO rig(metric, rate_from := NULL, rate_to := NULL, days := 60) AS TABLE
WITH l AS (
    SELECT *, CASE WHEN rig IS DISTINCT FROM lag(rig) OVER own THEN 1 ELSE 0 END AS new
    FROM levels(metric, rate_from := rate_from, rate_to := rate_to)
    WHERE rig IS NOT NULL AND boat IS NOT NULL AND started IS NOT NULL
    WINDOW own AS (PARTITION BY athlete, boat, comparable ORDER BY started, recording)
),
stretch AS (
    SELECT *, sum(new) OVER (PARTITION BY athlete, boat, comparable ORDER BY started, recording) AS number FROM l
),
change AS (
    SELECT athlete, boat, comparable, number, min(started) AS changed_on FROM stretch WHERE number > 1 GROUP BY ALL
),
g AS (
    SELECT athlete, boat, comparable, c.number AS change, s.number = c.number AS after, any_value(rig) AS rig,
        any_value(changed_on) AS changed_on, count(*) AS sessions, unnest(pooled(list(level), list(se)))
    FROM stretch s JOIN change c USING (athlete, boat, comparable)
    WHERE s.number IN (c.number, c.number - 1) AND abs(epoch(started) - epoch(changed_on)) <= days * 86400.0
    GROUP BY athlete, boat, comparable, c.number, s.number
),
b AS (
    SELECT athlete, boat, comparable, strftime(p.changed_on, '%Y-%m-%d') AS day, a.rig AS before, p.rig AS after,
        a.sessions AS n_before, p.sessions AS n_after, a.mean AS mean_before, p.mean AS mean_after,
        p.mean - a.mean AS change, sqrt(a.se * a.se + p.se * p.se) AS se, least(a.sessions, p.sessions) - 1 AS df
    FROM g p JOIN g a USING (athlete, boat, comparable, change)
    WHERE p.after AND NOT a.after AND least(a.sessions, p.sessions) > 1
)
SELECT * EXCLUDE (se, df), change - t95(df) * se AS low, change + t95(df) * se AS high, se,
    abs(change) > t999(df) * se AS changed
FROM b ORDER BY athlete, boat, day;

-- Changes over the months and with a rig, in one form: one row a comparison, with the probability `chance` of a change of this
-- size or larger without a true one (two-sided).
CREATE MACRO comparisons(metric) AS TABLE
SELECT metric AS metric, 'trend' AS kind, athlete, comparable, change, low * change / per_month AS low,
    high * change / per_month AS high, sessions, first_month || ' to ' || last_month AS period,
    chance(abs(per_month) / se, months - 2) AS chance
FROM changes(metric) WHERE se > 0.0 AND per_month <> 0.0
UNION ALL
SELECT metric, 'rig', athlete, comparable, change, low, high, n_before + n_after,
    before || ' to ' || after || ', ' || day, chance(abs(change) / se, least(n_before, n_after) - 1)
FROM rig(metric) WHERE se > 0.0;

-- One row an outing and seat: catch relative to the stroke seat, s; positive is later. Recordings of a boat belong to one outing
-- if they overlap in absolute time. The stroke seat is the one nearest to the stern of those that overlap. `delays` matches
-- the strokes as `oarlock crew` does. `one_start`: both begin at the same moment, as one logger's do; else an offset between
-- two clocks is in `late_s`.
CREATE MACRO outings() AS TABLE
WITH crew AS (
    SELECT recording, boat, comparable, started, epoch(started) AS from_s, epoch(started) + duration_s AS to_s,
        seat_place(seat) AS place
    FROM recordings WHERE status = 'done' AND boat IS NOT NULL AND started IS NOT NULL AND seat_place(seat) IS NOT NULL
),
pairs AS (
    SELECT o.recording, l.recording AS leader, o.started = l.started AS one_start, o.from_s - l.from_s AS after_s
    FROM crew o JOIN crew l ON o.boat = l.boat AND o.comparable = l.comparable AND o.place < l.place
        AND o.from_s < l.to_s AND l.from_s < o.to_s
    QUALIFY row_number() OVER (PARTITION BY o.recording
        ORDER BY l.place DESC, least(o.to_s, l.to_s) - greatest(o.from_s, l.from_s) DESC, l.recording) = 1
),
k AS (
    SELECT recording, list(value ORDER BY value) AS catches, list(rate ORDER BY value) AS rates
    FROM stroke_values('catch_time_s') WHERE value IS NOT NULL
        AND recording IN (SELECT recording FROM pairs UNION ALL SELECT leader FROM pairs)
    GROUP BY recording
),
d AS (
    SELECT p.recording, one_start, unnest(delays(l.catches, o.catches, after_s)) AS late_s, unnest(o.rates) AS rate
    FROM pairs p JOIN k o ON o.recording = p.recording JOIN k l ON l.recording = p.leader
),
g AS (
    SELECT recording, count(*) AS strokes, avg(late_s) AS late_s, stddev_samp(late_s) AS sd_s,
        stddev_samp(late_s) / sqrt(count(*)) AS se_s, avg(rate) AS rate, bool_and(one_start) AS one_start
    FROM d WHERE late_s IS NOT NULL GROUP BY recording HAVING count(*) >= 10
)
SELECT recording, boat, started, comparable, athlete, seat, month, g.strokes, late_s, sd_s, se_s, rate, one_start
FROM g JOIN recordings USING (recording);

-- One row a boat, seat and month: catch relative to the stroke seat. Where `one_start` is false, an offset between the clocks of
-- two loggers is in `late_s`; `sd_s`, the scatter, is free of it.
CREATE MACRO crew() AS TABLE
WITH g AS (
    SELECT boat, seat, athlete, comparable, month, count(*) AS outings, sum(strokes)::BIGINT AS strokes,
        unnest(pooled(list(late_s), list(se_s))), sqrt(avg(sd_s * sd_s)) AS sd_s, bool_and(one_start) AS one_start
    FROM outings() GROUP BY boat, seat, athlete, comparable, month
)
SELECT boat, seat, athlete, comparable, month, outings, strokes, mean AS late_s, mean - t95(outings - 1) * se AS low_s,
    mean + t95(outings - 1) * se AS high_s, sd_s, one_start
FROM g ORDER BY boat, seat, comparable, month;

-- One row an athlete, number about the sensors and month, of runs that count.
CREATE VIEW sensor_health AS
WITH h AS (
    SELECT r.athlete, r.month, unnest(map_entries(u.health)) AS entry, r.recording
    FROM recordings r JOIN runs u USING (recording, run)
)
SELECT athlete, entry.key AS number, month, count(*) AS recordings, avg(entry.value) AS mean, max(entry.value) AS worst,
    arg_max(recording, entry.value) AS worst_recording
FROM h GROUP BY ALL ORDER BY athlete, number, month;

-- One row a recording of which the run that counts has failed.
CREATE VIEW failed AS
SELECT recording, coalesce(file, device) AS source, athlete, boat, started, run, fault FROM recordings
WHERE status = 'failed' ORDER BY started, recording;

-- One row a class of runs: only numbers of one class are compared.
CREATE VIEW classes AS
SELECT comparable, string_agg(DISTINCT engine, ', ') AS engine, count(*) AS recordings, min(started) AS first,
    max(started) AS last
FROM recordings WHERE status = 'done' GROUP BY comparable ORDER BY recordings DESC, comparable;
