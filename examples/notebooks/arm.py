"""Track an arm, offline and sample by sample. For engineers."""

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
    # Track an arm

    Three inertial units on an arm, arrays in memory, joint angles out, then the same live. No file and no
    rowing. Here signals are simulated; put your own arrays in their place. The arm's base stands still, so
    no movement shows where it faces: `azimuth_fixed` says that the direction of magnetic north in the model
    file is the true one.
    """)
    return


@app.cell
def _():
    import numpy as np

    import oarlock

    arm = oarlock.load_model("arm7").with_tables({"world": {"azimuth_fixed": True}})
    time_s = np.arange(0.0, 8.0, 0.01)
    _turn = 2 * np.pi * 0.4 * time_s
    swing = {
        "shoulder_flexion": 0.6 + 0.5 * np.sin(_turn),
        "shoulder_abduction": 0.3 + 0.2 * np.sin(0.7 * _turn),
        "elbow_flexion": 1.0 + 0.7 * np.sin(_turn - 0.6),
        "elbow_rotation": 0.4 * np.sin(0.5 * _turn),
    }
    everything = {name: swing.get(name, np.zeros_like(time_s)) for name in arm.joint_names}
    truth, measured = oarlock.simulate(
        arm,
        oarlock.simulation.Motion(tuple(everything), time_s, np.column_stack(list(everything.values()))),
        rate_hz=100.0,
        seed=2,
    )
    measured
    return (
        np,
        oarlock,
        arm,
        time_s,
        swing,
        everything,
        truth,
        measured,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    A recording is made of plain arrays. Time is in s, angular velocity in rad/s, specific force in m/s²
    (+9.81 upwards at rest); NaN marks a missing reading.
    """)
    return


@app.cell
def _(arm, measured, oarlock, truth):
    streams = [
        oarlock.recording.ImuStream(
            unit.name, unit.time_s, gyro_rad_s=unit.gyro_rad_s, accel_m_s2=unit.accel_m_s2, mag_ut=unit.mag_ut
        )
        for unit in measured
    ]
    recording = oarlock.Recording(streams)
    track = oarlock.smooth(oarlock.track(arm, recording))
    track.plot(["shoulder_flexion", "elbow_flexion"], truth=truth)[0]
    return (
        streams,
        recording,
        track,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Where is the hand?

    Positions come with their covariance, so a controller can weigh them.
    """)
    return


@app.cell
def _(time_s, track):
    position_m = track.frame_positions("hand")
    std_m = track.frame_position_stds("hand")
    for _k in range(0, len(time_s) - 10, 200):
        _place = ", ".join(f"{x:+.3f}" for x in position_m[_k])
        print(f"{track.time_s[_k]:5.2f} s   {_place} m   +- {1e3 * 1.96 * std_m[_k].max():.1f} mm")
    return (
        position_m,
        std_m,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## Live

    `Tracker.step` takes one sample at a time and gives the same numbers as `oarlock.track`, bit for bit. It
    needs the first tenth of a second to find the start. This loop is your control loop.
    """)
    return


@app.cell
def _(arm, np, oarlock, recording):
    from time import perf_counter

    tracker = oarlock.Tracker(arm)
    elbow = tracker.state_names.index("elbow_flexion")
    angles_rad, took_s = [], []
    for sample in tracker.samples(recording):
        _began_s = perf_counter()
        belief, info = tracker.step(sample)
        took_s.append(perf_counter() - _began_s)
        angles_rad.append(np.nan if belief is None else belief.mean[elbow])
    filtered = oarlock.track(arm, recording)
    _started = np.isfinite(angles_rad)
    print(
        "the same numbers:",
        np.array_equal(np.array(angles_rad)[_started], filtered.hinge("elbow_flexion").angle_rad[_started]),
    )
    print(f"median step: {1e6 * np.median(took_s):.0f} microseconds, of the 10000 between two samples")
    return (
        perf_counter,
        tracker,
        elbow,
        angles_rad,
        took_s,
        sample,
        belief,
        info,
        filtered,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    ## A sensor fails

    Take the forearm's unit away for two seconds. The hand's unit still carries some of the information, so
    the band, drawn alone here, widens and closes again.
    """)
    return


@app.cell
def _(arm, np, oarlock, recording):
    import matplotlib.pyplot as plt

    _unit = recording["forearm"]
    _gone = (_unit.time_s > 3.0) & (_unit.time_s < 5.0)
    _gyro, _accel, _mag = (
        np.where(_gone[:, None], np.nan, values)
        for values in (_unit.gyro_rad_s, _unit.accel_m_s2, _unit.mag_ut)
    )
    damaged = oarlock.Recording(
        [
            *recording.without("forearm"),
            oarlock.recording.ImuStream(
                "forearm", _unit.time_s, gyro_rad_s=_gyro, accel_m_s2=_accel, mag_ut=_mag
            ),
        ]
    )
    gap = oarlock.track(arm, damaged)
    _figure, _ax = plt.subplots(figsize=(7.5, 2.6), layout="constrained")
    _ax.plot(gap.time_s, 1.96 * gap.hinge("elbow_flexion").std_deg)
    _ax.set_title("elbow flexion, 95 % band, deg", loc="left", fontsize=10)
    _ax.set_xlabel("time, s")
    _ax.set_yscale("log")
    _ax
    return (
        plt,
        damaged,
        gap,
    )


@app.cell(hide_code=True)
def _(mo):
    mo.md(r"""
    For sensors that send by network, Bluetooth or cable: [docs/live.md](../../docs/live.md).
    """)
    return


if __name__ == "__main__":
    app.run()
