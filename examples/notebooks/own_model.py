"""Change a model file and see what it does. For students."""

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
    # Change the model

    A body is a text file: joints, frames, sensors. You change one without programming. This notebook takes
    a unit off an arm, makes a mistake on purpose, and finds out what the unit is worth.
    """)
    return


@app.cell
def _():
    from pathlib import Path
    from tempfile import mkdtemp

    import oarlock

    arm = oarlock.load_model("arm7").with_tables({"world": {"azimuth_fixed": True}})
    arm
    return (
        Path,
        mkdtemp,
        oarlock,
        arm,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## A file that extends another

    Name only what differs. Here: no unit on the hand, and the direction of magnetic north is known
    (`azimuth_fixed`; an arm on a base that stands still cannot find it out by moving).
    """)
    return


@app.cell
def _(Path, mkdtemp, oarlock):
    folder = Path(mkdtemp())
    file = folder / "my_arm.toml"
    text = """
    format = 1
    name = "my_arm"
    extends = "arm7"

    [world]
    azimuth_fixed = true

    [remove]
    sensor = ["hand"]
    """
    file.write_text(text, encoding="utf-8")
    mine = oarlock.load_model(file)
    print("sensors:", *mine.sensor_names)
    print("parameters, m:", mine.parameters)
    return (
        folder,
        file,
        text,
        mine,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Mistakes are named

    A misspelt name does not pass. The error has the file, the line and the nearest name.
    """)
    return


@app.cell
def _(folder, oarlock, text):
    (folder / "wrong.toml").write_text(text.replace('"hand"', '"hnad"'), encoding="utf-8")
    try:
        oarlock.load_model(folder / "wrong.toml")
    except oarlock.ModelError as _error:
        print(_error)
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## What is the unit on the hand worth?

    Simulate one movement, then track it with both models. The simulation knows the truth.
    """)
    return


@app.cell
def _(arm, oarlock):
    import numpy as np

    time_s = np.arange(0.0, 10.0, 0.02)
    _random = np.random.default_rng(1)
    values = {}
    for _joint in arm.describe().joints:
        _low, _high = _joint.limits
        _middle, _swing = (_low + _high) / 2, (_high - _low) / 6
        _rate_hz, _phase = _random.uniform(0.2, 0.6), _random.uniform(0, 2 * np.pi)
        values[_joint.name] = _middle + _swing * np.sin(2 * np.pi * _rate_hz * time_s + _phase)
    motion = oarlock.simulation.Motion(tuple(values), time_s, np.column_stack(list(values.values())))
    truth, recording = oarlock.simulate(arm, motion, seed=1)
    recording
    return (
        np,
        time_s,
        values,
        motion,
        truth,
        recording,
    )


@app.cell
def _(arm, mine, oarlock, recording, truth):
    with_hand = oarlock.smooth(oarlock.track(arm, recording))
    without_hand = oarlock.smooth(oarlock.track(mine, recording.without("hand")))
    oarlock.evaluate(with_hand, truth)
    return (
        with_hand,
        without_hand,
    )


@app.cell
def _(oarlock, truth, without_hand):
    oarlock.evaluate(without_hand, truth)
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Without the unit on the hand, the wrist is no longer observed: `evaluate` gives no error for it, and
    `plot` draws it dotted. Shoulder and elbow are hardly worse. **A sensor informs about the joints below
    it and, through the chain, little about those above.**
    """)
    return


@app.cell
def _(truth, without_hand):
    without_hand.plot(["elbow_flexion", "hand_flexion"], truth=truth)[0]
    return


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    Try it: make the gyroscope ten times noisier (`[[sensor]]`, `name = "forearm"`, `gyro_std_rad_s = 0.05`)
    and track again. All keys: [docs/model-files.md](../../docs/model-files.md).
    """)
    return


if __name__ == "__main__":
    app.run()
