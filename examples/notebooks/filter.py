"""Look into the filter: steps, innovations, consistency and a small study. For those who work on the code."""

import marimo

__generated_with = "0.25.2"
app = marimo.App()


@app.cell
def _():
    import marimo as mo

    return (mo,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    # Inside the filter

    For a change of the code: how to look at single updates, at the consistency of the standard deviations,
    and at a change over several seeds. The equations stand in
    [docs/filter.md](../../docs/filter.md).
    """)
    return


@app.cell
def _():
    import numpy as np

    import oarlock
    from oarlock import rowing

    model = oarlock.load_model("sculler")
    motion = rowing.sculling(model, duration_s=6)
    truth, recording = oarlock.simulate(model, motion, seed=1)
    tracker = oarlock.Tracker(model)
    samples = tracker.samples(recording)
    print(
        len(samples),
        "samples,",
        len(tracker.state_names),
        "states,",
        len(model.measurement_names),
        "readings",
    )
    return (
        np,
        oarlock,
        rowing,
        model,
        motion,
        truth,
        recording,
        tracker,
        samples,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## One update

    `step` returns the state estimate and a report: innovation (U3), NIS, and per sensor how many readings
    were used, rejected and missing.
    """)
    return


@app.cell
def _(np, samples, tracker):
    for sample in samples[:250]:
        belief, info = tracker.step(sample)
    print(
        f"{info.time_s:.3f} s: {info.status}, NIS {info.nis:.1f} of {np.isfinite(info.innovation).sum()} readings"
    )
    info.sensors["back"]
    return (
        sample,
        belief,
        info,
    )


@app.cell
def _(belief, np):
    import matplotlib.pyplot as plt

    _std = np.sqrt(np.diag(belief.covariance))
    _figure, _ax = plt.subplots(figsize=(6, 5), layout="constrained")
    _image = _ax.imshow(belief.covariance / np.outer(_std, _std), cmap="RdBu_r", vmin=-1, vmax=1)
    _ax.set_title("correlation of the states", loc="left")
    _ax.set_xlabel("state")
    _ax.set_ylabel("state")
    _figure.colorbar(_image)
    _ax
    return (plt,)


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Is it consistent?

    NIS per reading and NEES per state are about 1 for a consistent filter (Bar-Shalom, Li and Kirubarajan
    2001, section 5.4). Below 1 the filter claims too little, above 1 too much.
    """)
    return


@app.cell
def _(model, oarlock, recording, truth):
    track = oarlock.track(model, recording)
    evaluation = oarlock.evaluate(track, truth)
    print(f"NEES per state {evaluation.states.nees:.2f}, 95 % interval {evaluation.states.interval_95}")
    evaluation
    return (
        track,
        evaluation,
    )


@app.cell
def _(np, plt, track):
    _settled = track.time_s > 2.0
    _figure, _ax = plt.subplots(figsize=(7.5, 2.8), layout="constrained")
    for _name in ("back", "r_forearm", "l_forearm"):
        _k = track.info.sensor_names.index(_name)
        _nis = (track.info.nis[:, _k] / track.info.used[:, _k])[_settled]
        _ax.plot(track.time_s[_settled], np.convolve(_nis, np.ones(25) / 25, mode="same"), label=_name)[0]
    _ax.axhline(1.0, color="0.3", linewidth=0.8)
    _ax.set_title("NIS per reading, mean of 0.2 s", loc="left")
    _ax.set_xlabel("time, s")
    _ax.legend(frameon=False)
    _ax
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## A change, over several seeds

    One seed proves nothing. `track_many` tracks several on all cores, bit for bit as `track`.
    """)
    return


@app.cell
def _(model, motion, np, oarlock):
    trials = [oarlock.simulate(model, motion, seed=seed) for seed in range(4)]
    recordings = [trial[1] for trial in trials]
    means = {}
    for filter_name in ("ukf", "ekf", "factorised"):
        _config = oarlock.Config(filter=filter_name)
        _tracks = oarlock.track_many(model, recordings, config=_config, progress=True)
        means[filter_name] = [
            oarlock.evaluate(t, trial[0]).mean_rmse_deg() for t, trial in zip(_tracks, trials, strict=True)
        ]
    for _name, _values in means.items():
        print(f"{_name:12} {np.mean(_values):.4f} deg, seeds {min(_values):.4f} to {max(_values):.4f}")
    return (
        trials,
        recordings,
        means,
        filter_name,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    For a study with many settings write a file and run `oarlock lab study`:
    [docs/study.md](../../docs/study.md). Before you send a change: `make lint` and `make test`.
    """)
    return


if __name__ == "__main__":
    app.run()
