"""The program's commands as functions; each returns what the program prints with ``--json``.

Written by ``tools/commands.py`` from the program's own description. Keywords are flags, and those
that are left out have the program's defaults. A table is the path of a file, or columns in memory:
a frame of pandas or polars, or a dictionary of arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from . import _program
from ._program import Path, Place, Result, Table, run

if TYPE_CHECKING:
    import pandas as pd

EstimatorName = Literal[
    "default",
    "team",
    "several",
    "grid",
    "particle",
    "iterated-posterior-linearisation",
    "ukf",
    "ekf",
    "imm",
    "gaussian-sum",
    "particle-bearing",
    "particle-bearing-moving",
    "batch",
    "batch-robust",
    "range-difference",
    "magnetic-dipole",
    "pulses",
    "ukf-pritzl2018",
    "ekf-pritzl2018",
    "ukf-pritzl2018-variance",
    "ekf-iterated",
    "ekf-dual",
    "cubature",
    "iterated-posterior-linearisation-robust",
    "range-parameterised",
    "particle-adaptive",
    "particle-rao-blackwellised",
    "grid-free-exponent",
    "level-difference",
    "level-difference-bearing",
    "range-difference-bearing",
    "particle-isaacs2014",
]
PlannerName = Literal[
    "pritzl2018",
    "pritzl2018-emulated",
    "waypoints",
    "lawn-mower",
    "detection",
    "orbit",
    "arcs",
    "surge-cast",
    "information",
    "steepest-descent",
    "bayesian-optimisation",
    "hold",
]
ExtractorName = Literal[
    "pritzl2018",
    "maximum",
    "first-harmonic",
    "first-harmonic-db",
    "main-lobe",
    "cross-correlation",
    "maximum-likelihood",
    "maximum-likelihood-t",
    "maximum-likelihood-reflection",
    "maximum-likelihood-several",
]
EstimatorName2 = Literal[
    "default",
    "team",
    "several",
    "grid",
    "particle",
    "iterated-posterior-linearisation",
    "ukf",
    "ekf",
    "imm",
    "gaussian-sum",
    "particle-bearing",
    "particle-bearing-moving",
    "batch",
    "batch-robust",
    "range-difference",
    "magnetic-dipole",
    "pulses",
    "shadowing-grid",
    "bearing-grid",
    "multilateration",
    "range-differences",
    "ukf-pritzl2018",
    "ekf-pritzl2018",
    "ukf-pritzl2018-variance",
    "ekf-iterated",
    "ekf-dual",
    "cubature",
    "iterated-posterior-linearisation-robust",
    "range-parameterised",
    "particle-adaptive",
    "particle-rao-blackwellised",
    "grid-free-exponent",
    "level-difference",
    "level-difference-bearing",
    "range-difference-bearing",
    "particle-isaacs2014",
    "strongest",
    "weighted-centroid",
    "field-map",
    "least-absolute",
    "batch-multistart",
    "lenth1981",
    "lenth1981-huber",
    "lenth1981-andrews",
    "repeated-median",
    "pseudolinear",
    "stansfield",
    "instrumental-variables",
]
CaseName = Literal[
    "bearing-clean",
    "bearing-lost",
    "bearing-reflector",
    "bearing-scattered",
    "bearing-65",
    "bearing-block",
]
WhatName = Literal[
    "scenarios",
    "trials",
    "estimators",
    "extractors",
    "planners",
    "sources",
    "cases",
    "keys",
]

__all__ = [
    "CampaignOptions",
    "Path",
    "Place",
    "Result",
    "Table",
    "run",
    "antenna",
    "bearing",
    "calibrate",
    "campaign",
    "compare_antennas",
    "compare_estimators",
    "compare_extractors",
    "compare_planners",
    "compare_sigmas",
    "convert",
    "fleets",
    "hunt",
    "judge",
    "list_",
    "listen",
    "locate",
    "page",
    "plot_axes",
    "plot_bearing_errors",
    "plot_cloud",
    "plot_distributions",
    "plot_error",
    "plot_levels",
    "plot_nees",
    "plot_pattern",
    "plot_phases",
    "plot_planners",
    "plot_rssi",
    "plot_trajectory",
    "pulses",
    "replay",
    "results",
    "results_merge",
    "soak",
    "tags",
]


def hunt(
    scenario: Path | None = None,
    *,
    seed: int | None = None,
    estimator: EstimatorName | None = None,
    planner: PlannerName | None = None,
    source: Path | float | None = None,
    dynamics: Literal["isaacs2014", "rigid-body"] | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    components: Literal["both", "rss", "bearing"] | None = None,
    prior_sigma_m: float | None = None,
    power_sigma_db: float | None = None,
    bearing_sigma_deg: float | None = None,
    lag_s: float | None = None,
    calibration: Path | None = None,
    live: Path | float | None = None,
    live_token: Path | float | None = None,
    live_until_done: bool = False,
    tiles: Path | None = None,
    cot: Path | float | Sequence[Path | float] | None = None,
    cot_ca: Path | None = None,
    cot_cert: Path | None = None,
    cot_key: Path | None = None,
    cot_server_name: Path | float | None = None,
    cot_from: Path | float | None = None,
    mqtt: Path | float | None = None,
    mqtt_user: Path | float | None = None,
    pace: float | None = None,
    out: Path | None = None,
    export: Path | Sequence[Path] | None = None,
    origin: Place | None = None,
    start_utc: float | None = None,
) -> Result:
    """Fly one simulated hunt: ``foxhunt hunt``.

    Flies the drones of a scenario through a simulated hunt for its beacons, one after the other
    or, where turns are shared, all at once. Prints a table of fixes against the truth, and
    writes a log, a picture and a page that shows the hunt in any browser. The same scenario,
    estimator and seed fly the same hunt.

    The log and the pictures are left in the folder ``out``. Without it nothing is left; a folder of
    that name is the program's own default.

    >>> found = hunt(seed=1)["beacons"]
    >>> [beacon["error_m"] < 3 for beacon in found]
    [True, True]

    Args:
        scenario: A built-in scenario (`foxhunt list scenarios`) or a TOML file [default:
            pritzl-6.1]
        seed: The seed of all random numbers [default: 1]
        estimator: The estimator (`foxhunt list estimators` describes them) [default: the
            scenario's own] These are the names to choose from; `foxhunt list estimators --all`
            has more.
        planner: The planner (`foxhunt list planners` describes them) [default: the scenario's
            own]
        source: The source that all drones listen with (`foxhunt list sources`) [default: the
            scenario's own]
        dynamics: The equations of motion of a scenario's quadrotors [default: the scenario's
            own]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        components: The components of a reception that it uses
        prior_sigma_m: The prior σ of each coordinate of a beacon about the formation's start, in
            metres
        power_sigma_db: The prior σ of the reference power in dB, which is then estimated along
            with the place; 0 if it is known
        bearing_sigma_deg: A σ in degrees added in squares to that of each bearing, for errors
            that no turn shows, such as turned patterns
        lag_s: Fuse receptions at their own time if they come at most this many seconds late
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        live: Show the hunt in browsers while it goes on [default address: 127.0.0.1:8017]; an
            address that others can reach needs a token
        live_token: A token that viewers need; FOXHUNT_LIVE_TOKEN in the environment does the
            same, and is not shown in lists of processes
        live_until_done: End with the hunt; the page is served until Ctrl-C otherwise
        tiles: A map below the hunt, in the live view and in the page, from tiles on this
            computer: a folder with z/x/y.png, or an .mbtiles or .pmtiles file of images; the
            hunt needs an origin in degrees
        cot: Send receivers, fixes, 95 % ellipses and bearings to a TAK server or team, as Cursor
            on Target: tcp://HOST:8087, tls://HOST:8089 or udp://239.2.3.1:6969; may be given
            several times
        cot_ca: For --cot tls://: the authorities that the server's certificate is checked by,
            PEM or PKCS#12, such as truststore-root.p12; FOXHUNT_COT_PASSWORD in the environment
            opens what is encrypted
        cot_cert: For --cot tls://: one's own certificate, PEM, or PKCS#12 with its key
        cot_key: For --cot tls://: the key of --cot-cert, PEM
        cot_server_name: For --cot tls://: the name in the server's certificate, if it is not the
            host of the address
        cot_from: For --cot udp://: the address of the network card that datagrams leave by
        mqtt: Send the place of every beacon and receiver to an MQTT broker, for Home Assistant
            and Node-RED; port 1883 if none is given
        mqtt_user: For --mqtt: the user name at the broker, if it needs one; the password is
            $FOXHUNT_MQTT_PASSWORD
        pace: With --live, --cot or --mqtt: the simulated seconds that pass in one second
            [default: 20]
        out: The folder for hunt.jsonl (the log), hunt.svg (the picture) and report.html (the
            page) [default: out]
        export: Write places, bearings, ellipses, regions and paths to a file, in the format of
            its ending: .geojson, .kml, .czml, .gpx, .csv, .cot (Cursor on Target) or .mcap; or
            the probability of each cell as .tif (GeoTIFF), .kmz (overlay), .mbtiles or .png; may
            be given several times
        origin: The place of the local origin on Earth (WGS84), for --export, --tiles, --cot,
            --mqtt and programs that fetch a hunt from --live, if it is not known
        start_utc: The UTC of the time 0, for --export, if it is not known
    """
    flags: dict[str, Any] = {
        "seed": seed,
        "estimator": estimator,
        "planner": planner,
        "source": source,
        "dynamics": dynamics,
        "extractor": extractor,
        "antenna": antenna,
        "components": components,
        "prior-sigma-m": prior_sigma_m,
        "power-sigma-db": power_sigma_db,
        "bearing-sigma-deg": bearing_sigma_deg,
        "lag-s": lag_s,
        "calibration": calibration,
        "live": live,
        "live-token": live_token,
        "live-until-done": live_until_done,
        "tiles": tiles,
        "cot": cot,
        "cot-ca": cot_ca,
        "cot-cert": cot_cert,
        "cot-key": cot_key,
        "cot-server-name": cot_server_name,
        "cot-from": cot_from,
        "mqtt": mqtt,
        "mqtt-user": mqtt_user,
        "pace": pace,
        "out": out,
        "export": export,
        "origin": origin,
        "start-utc": start_utc,
    }
    return _program.hunt(scenario, flags)


def campaign(
    scenario: Path | None = None,
    *,
    runs: int = 100,
    seed: int = 1,
    jobs: int | None = None,
    quiet: bool = False,
    estimator: EstimatorName | Sequence[EstimatorName] | None = None,
    planner: PlannerName | None = None,
    source: Path | float | None = None,
    dynamics: Literal["isaacs2014", "rigid-body"] | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    components: Literal["both", "rss", "bearing"] | None = None,
    prior_sigma_m: float | None = None,
    power_sigma_db: float | None = None,
    bearing_sigma_deg: float | None = None,
    lag_s: float | None = None,
    calibration: Path | None = None,
    store: Path | None = None,
    store_logs: bool = False,
    shard: Path | float | None = None,
) -> pd.DataFrame:
    """Fly a hunt many times and compare estimators: ``foxhunt campaign``.

    Flies the same scenario again and again, each run with the next seed and each estimator on
    the same seeds. Prints the distribution of the errors, the steps and the time until the 95 %
    ellipse's semi-major axis is below 3 m, and whether the estimators are consistent.

    With --store every run is kept in a file. The same command again flies only what is missing
    in it and prints the table of the whole; `foxhunt results` works on the file.

    Returns a data frame with one row for each run, estimator and beacon: seed, error in metres,
    NEES, steps and how the search ended; a run that could not go on is one row without a beacon
    whose outcome is ``failed``. ``run("campaign", ...)`` gives the summary instead.

    >>> frame = campaign("pritzl-6.1", runs=2, estimator=["ekf", "ukf"])
    >>> frame.groupby("estimator").size().to_dict()
    {'ekf': 4, 'ukf': 4}

    Args:
        runs: Number of hunts.
        seed: Seed of the first run; run i has the seed ``seed`` + i.
        scenario: A built-in scenario (`foxhunt list scenarios`) or a TOML file [default:
            pritzl-6.1]
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        quiet: Print no progress on standard error
        estimator: An estimator; may be repeated [default: the scenario's own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        planner: The planner (`foxhunt list planners` describes them) [default: the scenario's
            own]
        source: The source that all drones listen with (`foxhunt list sources`) [default: the
            scenario's own]
        dynamics: The equations of motion of a scenario's quadrotors [default: the scenario's
            own]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        components: The components of a reception that it uses
        prior_sigma_m: The prior σ of each coordinate of a beacon about the formation's start, in
            metres
        power_sigma_db: The prior σ of the reference power in dB, which is then estimated along
            with the place; 0 if it is known
        bearing_sigma_deg: A σ in degrees added in squares to that of each bearing, for errors
            that no turn shows, such as turned patterns
        lag_s: Fuse receptions at their own time if they come at most this many seconds late
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        store: Keep every run in this file as it ends; runs that it already holds are not flown
            again
        store_logs: Keep the log of every hunt, too; runs already in the store get no log
        shard: Fly part K of N of the runs, K from 1, or `auto`: K and N from SLURM, Kubernetes
            or MPI
    """
    flags: dict[str, Any] = {
        "jobs": jobs,
        "quiet": quiet,
        "estimator": estimator,
        "planner": planner,
        "source": source,
        "dynamics": dynamics,
        "extractor": extractor,
        "antenna": antenna,
        "components": components,
        "prior-sigma-m": prior_sigma_m,
        "power-sigma-db": power_sigma_db,
        "bearing-sigma-deg": bearing_sigma_deg,
        "lag-s": lag_s,
        "calibration": calibration,
        "store": store,
        "store-logs": store_logs,
        "shard": shard,
    }
    return _program.campaign(scenario, runs, seed, flags)


def fleets(
    *,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    planner: PlannerName | None = None,
    estimator: EstimatorName | None = None,
) -> Any:
    """Fly random fleets and check the rules of the air: ``foxhunt fleets``.

    Flies hunts with fleets of one to eight drones in which everything that may go wrong is drawn
    at random. Checks that no drone came nearer to another than its separation, left the fence or
    the band of altitudes, or flew with empty batteries, and counts how searches ended. The exit
    code is 1 if a rule was broken or a hunt failed. `fleet-` and a seed is the scenario of one
    of the hunts.

    Args:
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        planner: The planner (`foxhunt list planners` describes them) [default: the scenario's
            own]
        estimator: The estimator [default: the scenarios' own] These are the names to choose
            from; `foxhunt list estimators --all` has more.
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "planner": planner,
        "estimator": estimator,
    }
    return _program.command(["fleets"], flags)


def soak(
    *,
    hours: float | None = None,
    runs: int | None = None,
    again: Path | None = None,
    seed: int | None = None,
    jobs: int | None = None,
    quiet: bool = False,
    out: Path | None = None,
    recordings: bool = False,
    class_: Path | float | Sequence[Path | float] | None = None,
    against: Path | float | Sequence[Path | float] | None = None,
    write: Path | None = None,
    data: Path | None = None,
) -> Any:
    """Fly random hunts for hours and check invariants: ``foxhunt soak``.

    Each seed draws a fleet with everything that may go wrong, beacons, estimator, extractor,
    antenna and planner, and flies it twice; every fourth one draws a recording instead, bends
    and cuts it, and locates with it; with the feature `hardware` every eighth one flies emulated
    devices whose cables, links and autopilots fail. Checks that each search has an end or a
    reason, that drones keep separation, airspace and batteries, that estimates are finite and
    their covariances positive definite, that flight and replay repeat to the bit, that logs are
    read wherever they are cut off, and that memory does not grow. With --recordings it draws
    recordings as people make them and judges the estimators instead (docs/judging.md). The exit
    code is 1 if a check failed; the folder then has the files that show the failure again.

    Args:
        hours: Run for this time, in hours
        runs: Run this many runs
        again: Run one flight of a scenario's file, or one recording (.csv), such as an earlier
            soak left
        seed: The seed of the first run; run i has this plus i [default: 1]
        jobs: The number of runs at the same time [default: the number of processors]
        quiet: Print no progress on standard error
        out: The folder for the smallest scenario of each failure [default: soak]
        recordings: Draw recordings as people make them, by class, locate with each through a
            file, and judge the estimators by the truth: --runs counts the draws of each class
        class_: The classes to draw [default: all but the one of the largest recordings]
        against: The estimators beside the one that suits a recording: names, or `all` [default:
            simple methods and `batch-multistart`]
        write: Write the worst draw of each class to this folder, whole and cut down to the rows
            that still fail, with the commands that show it
        data: The folder of real recordings, some of which are cut and thinned [default:
            $FOXHUNT_DATA]
    """
    flags: dict[str, Any] = {
        "hours": hours,
        "runs": runs,
        "again": again,
        "seed": seed,
        "jobs": jobs,
        "quiet": quiet,
        "out": out,
        "recordings": recordings,
        "class": class_,
        "against": against,
        "write": write,
        "data": data,
    }
    return _program.command(["soak"], flags)


def locate(
    *files: Table,
    truth: Place | None = None,
    every_beacon: bool = False,
    track: bool = False,
    window_s: float | None = None,
    correlation_s: float | None = None,
    speed_mps: float | Sequence[float] | None = None,
    unknown_number: bool = False,
    ignore: Path | None = None,
    rows: int | None = None,
    movebank_to: Path | None = None,
    estimator: EstimatorName2 | None = None,
    p0_dbm: Path | float | None = None,
    exponent: Path | float | None = None,
    target_up_m: Path | float | None = None,
    receiver_antenna: Path | float | None = None,
    transmitter_antenna: Path | float | None = None,
    margin_m: float | None = None,
    receiver_sigma_m: float | None = None,
    reference_m: Path | float | None = None,
    seed: int | None = None,
    terrain: Path | None = None,
    up_from: Literal["ground", "take-off"] | None = None,
    frequency_mhz: float | None = None,
    calibration: Path | None = None,
    conformal: Path | None = None,
    site: Path | float | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    report: Path | None = None,
    tiles: Path | None = None,
    export: Path | Sequence[Path] | None = None,
    origin: Place | None = None,
    start_utc: float | None = None,
    cot: Path | float | Sequence[Path | float] | None = None,
    cot_ca: Path | None = None,
    cot_cert: Path | None = None,
    cot_key: Path | None = None,
    cot_server_name: Path | float | None = None,
    cot_from: Path | float | None = None,
    mqtt: Path | float | None = None,
    mqtt_user: Path | float | None = None,
) -> Result:
    """Locate a transmitter from recorded flights: ``foxhunt locate``.

    Estimates the place of one transmitter from one or several recordings: turns of a directional
    antenna, levels of an omnidirectional one, ready-made bearings, ranges or differences.
    Without --p0-dbm and --exponent, or a --calibration that has them, the transmitter's power is
    estimated along with its place, and the exponent if the estimator can; with --exponent alone,
    only the power. If nothing but silence was recorded, it reports where the transmitter is not:
    the probability that the search would have found it (POS).

    Files may be tables in memory.

    >>> import numpy as np
    >>> time = np.arange(20.0)
    >>> east, north = 60 * np.cos(time / 3), 60 * np.sin(time / 3)
    >>> compass = np.degrees(np.arctan2(20 - east, 15 - north)) % 360
    >>> walk = {"time_s": time, "east_m": east, "north_m": north, "bearing_deg_compass": compass}
    >>> found = locate(walk)["estimate"]
    >>> round(found["east_m"]), round(found["north_m"])
    (20, 15)

    Args:
        files: Recordings: CSV with named columns
        truth: The true place of the transmitter in degrees (WGS84), for the error [default: the
            recordings' own truth]
        every_beacon: Locate every beacon of the recordings, one after the other
        track: Track a moving transmitter: its place at each time, from all receptions before and
            after, by one or several receivers
        window_s: With --track: the length of a time window in seconds; receptions in one window
            are of one place [default: 30]
        correlation_s: With --track: the time in seconds over which shadowing and reflections
            stay alike; receptions within it count as one reading; levels stay alike four times
            as long [default: 240]
        speed_mps: With --track: the speeds that the transmitter may have, in m/s [default: 0.3,
            1, 3, 10]
        unknown_number: Find how many transmitters send on one frequency, and locate each: every
            bearing belongs to one of them or is wrong; after a search that received nothing,
            state how strong a transmitter is absent
        ignore: A list of receptions to leave out: saved by a page, or your own JSON lines
            (docs/report.md)
        rows: List the N rows that fit worst, 20 without N, with file, line and residual
        movebank_to: Write the places to a table with Movebank's names; needs recordings with
            times in UTC
        estimator: The estimator (`foxhunt list estimators` describes them); chosen by what was
            recorded unless given These are the names to choose from; `foxhunt list estimators
            --all` has more.
        p0_dbm: The power at one metre in dBm, or `free` where it is not known; needs --exponent
            [default: free]
        exponent: The path-loss exponent, or `free` where it is not known [default: free]
        target_up_m: Height of the transmitter above the ground in metres, or `free` where it is
            not known [default: 0; free for receivers that fly, if the estimator can estimate it]
        receiver_antenna: The receiver's antenna, whose vertical pattern the levels follow: a
            name or a file as for --antenna; where neither antenna is named, `shadowing-grid`
            infers what the levels lose at steep angles, and the others take them for isotropic
        transmitter_antenna: The transmitter's antenna, upright; isotropic unless given
        margin_m: Width of the margin searched around the area that was flown over, in metres;
            the default estimators of levels alone and of bearings alone begin with it, and widen
            it as needed [default: 200]
        receiver_sigma_m: Standard deviation of the receiver's own place on each axis, in metres,
            as its GNSS states it, for rows without receiver_sigma_m; unless given, 3 m for
            places in degrees, and places in metres are known
        reference_m: Place of the reference receiver of range and level differences, in metres of
            the local frame
        seed: The seed of estimators that draw random numbers [default: 1]
        terrain: Correct levels for the loss over the terrain in this folder's tiles: .hgt, or
            GeoTIFF in degrees (docs/terrain.md). Needs an estimator that takes levels in the
            order of time [default: `particle`]
        up_from: The zero of the recordings' heights; heights above the ellipsoid (alt_m) need
            `take-off` [default: ground]
        frequency_mhz: The transmitter's frequency, for the loss over the terrain [default: 2440]
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        conformal: Show a second region, which holds the transmitter with 95 % by your own
            recordings: the factors that `judge --calibrate` wrote
        site: The receiver's surroundings: open, forest, street, indoors or unknown; part of the
            σ of bearings from uncalibrated turns [default: unknown, which is wide]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        report: Write a page for any browser: one file, without a network
        tiles: A map below the page, from tiles on this computer: a folder with z/x/y.png, or an
            .mbtiles or .pmtiles file of images; the page brings the tiles about the places along
        export: Write places, bearings, ellipses, regions and paths to a file, in the format of
            its ending: .geojson, .kml, .czml, .gpx, .csv, .cot (Cursor on Target) or .mcap; or
            the probability of each cell as .tif (GeoTIFF), .kmz (overlay), .mbtiles or .png; may
            be given several times
        origin: The place of the local origin on Earth (WGS84), for --export, --tiles, --cot,
            --mqtt and programs that fetch a hunt from --live, if it is not known
        start_utc: The UTC of the time 0, for --export, if it is not known
        cot: Send receivers, fixes, 95 % ellipses and bearings to a TAK server or team, as Cursor
            on Target: tcp://HOST:8087, tls://HOST:8089 or udp://239.2.3.1:6969; may be given
            several times
        cot_ca: For --cot tls://: the authorities that the server's certificate is checked by,
            PEM or PKCS#12, such as truststore-root.p12; FOXHUNT_COT_PASSWORD in the environment
            opens what is encrypted
        cot_cert: For --cot tls://: one's own certificate, PEM, or PKCS#12 with its key
        cot_key: For --cot tls://: the key of --cot-cert, PEM
        cot_server_name: For --cot tls://: the name in the server's certificate, if it is not the
            host of the address
        cot_from: For --cot udp://: the address of the network card that datagrams leave by
        mqtt: Send the place of every beacon and receiver to an MQTT broker, for Home Assistant
            and Node-RED; port 1883 if none is given
        mqtt_user: For --mqtt: the user name at the broker, if it needs one; the password is
            $FOXHUNT_MQTT_PASSWORD
    """
    flags: dict[str, Any] = {
        "truth": truth,
        "every-beacon": every_beacon,
        "track": track,
        "window-s": window_s,
        "correlation-s": correlation_s,
        "speed-mps": speed_mps,
        "unknown-number": unknown_number,
        "ignore": ignore,
        "rows": rows,
        "movebank-to": movebank_to,
        "estimator": estimator,
        "p0-dbm": p0_dbm,
        "exponent": exponent,
        "target-up-m": target_up_m,
        "receiver-antenna": receiver_antenna,
        "transmitter-antenna": transmitter_antenna,
        "margin-m": margin_m,
        "receiver-sigma-m": receiver_sigma_m,
        "reference-m": reference_m,
        "seed": seed,
        "terrain": terrain,
        "up-from": up_from,
        "frequency-mhz": frequency_mhz,
        "calibration": calibration,
        "conformal": conformal,
        "site": site,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "report": report,
        "tiles": tiles,
        "export": export,
        "origin": origin,
        "start-utc": start_utc,
        "cot": cot,
        "cot-ca": cot_ca,
        "cot-cert": cot_cert,
        "cot-key": cot_key,
        "cot-server-name": cot_server_name,
        "cot-from": cot_from,
        "mqtt": mqtt,
        "mqtt-user": mqtt_user,
    }
    result: Result = _program.command(["locate", *files], flags)
    return result


def bearing(
    file: Table,
    *,
    all: bool = False,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    calibration: Path | None = None,
    site: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    report: Path | None = None,
    tiles: Path | None = None,
    export: Path | Sequence[Path] | None = None,
    origin: Place | None = None,
    start_utc: float | None = None,
) -> Result:
    """Find the bearing of each recorded turn: ``foxhunt bearing``.

    Estimates level and direction of arrival of each turn of a directional antenna in a
    recording, each with its standard deviation, and a confidence: how far the turn looks like
    one transmitter. Do not rely on a bearing of low confidence.

    Args:
        file: A recording: CSV with named columns
        all: Read each turn with every extractor; those with an antenna use that of --antenna, or
            else the reference patch
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        site: The receiver's surroundings: open, forest, street, indoors or unknown; part of the
            σ of bearings from uncalibrated turns [default: unknown, which is wide]
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        report: Write a page for any browser: one file, without a network
        tiles: A map below the page, from tiles on this computer: a folder with z/x/y.png, or an
            .mbtiles or .pmtiles file of images; the page brings the tiles about the places along
        export: Write places, bearings, ellipses, regions and paths to a file, in the format of
            its ending: .geojson, .kml, .czml, .gpx, .csv, .cot (Cursor on Target) or .mcap; or
            the probability of each cell as .tif (GeoTIFF), .kmz (overlay), .mbtiles or .png; may
            be given several times
        origin: The place of the local origin on Earth (WGS84), for --export, --tiles, --cot,
            --mqtt and programs that fetch a hunt from --live, if it is not known
        start_utc: The UTC of the time 0, for --export, if it is not known
    """
    flags: dict[str, Any] = {
        "all": all,
        "extractor": extractor,
        "antenna": antenna,
        "calibration": calibration,
        "site": site,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "report": report,
        "tiles": tiles,
        "export": export,
        "origin": origin,
        "start-utc": start_utc,
    }
    result: Result = _program.command(["bearing", file], flags)
    return result


def calibrate(
    *files: Path,
    truth: Place | None = None,
    target_up_m: float | None = None,
    max_exponent: float | None = None,
    least_range_m: float | None = None,
    out: Path | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
) -> Any:
    """Calibrate path loss, bearings and a station's antennas: ``foxhunt calibrate``.

    Fits to recordings of a transmitter at a known place (from --truth, or from the recording's
    own columns) all that they allow: the path loss P = P₀ − 10 γ log₁₀ d with the joint
    confidence region of P₀ and γ; the offset of bearings, and whether it depends on the heading,
    as a disturbed compass has it; the deviation of arrays that do not turn over the direction of
    arrival, from one beacon or from all whose place is known; the scale of their σ; and the
    boresights of stations with fixed antennas, all stations together. Prints what cannot be
    fitted, and why.

    Logs of hunts (.jsonl) with a truth are recordings, too; their bearings and σ are those of
    the hunt's extractor.

    --out writes the file that `foxhunt locate`, `bearing`, `hunt` and `campaign` take as
    --calibration.

    Args:
        files: Recordings: CSV with named columns, or logs of hunts
        truth: The place of the transmitter in degrees (WGS84) [default: the recordings' own
            truth]
        target_up_m: The height of the transmitter above the ground, in metres [default: 0]
        max_exponent: The largest path-loss exponent [default: no bound]
        least_range_m: Leave out bursts that a station received from nearer than this, in metres
            [default: 30]
        out: The file to write the calibration to
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
    """
    flags: dict[str, Any] = {
        "truth": truth,
        "target-up-m": target_up_m,
        "max-exponent": max_exponent,
        "least-range-m": least_range_m,
        "out": out,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
    }
    return _program.command(["calibrate", *files], flags)


def antenna(
    antenna: Path | None = None,
    *,
    learn: Path | Sequence[Path] | None = None,
    truth: Place | None = None,
    bearing_deg: float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    out: Path | None = None,
    write: Path | None = None,
) -> Any:
    """Print the figures of an antenna, and convert its file: ``foxhunt antenna``.

    Reads an antenna from a file (MSI Planet .msi or .pln, or .csv with one angle or with both),
    or takes one by its name, and prints its gain, beamwidths, front-to-back ratio and
    directivity.

    With --learn, learns the pattern from recorded turns with a transmitter in a known direction:
    at --truth, at --bearing-deg, or at the recordings' own truth. Its gain is about the mean
    over the turn.

    Args:
        antenna: An antenna file, or one of isotropic, dipole, cardioid, patch, yagi,
            reference-patch
        learn: Learn the pattern from the turns of these recordings
        truth: With --learn, the place of the transmitter in degrees (WGS84)
        bearing_deg: With --learn, the transmitter's direction in compass degrees, the same for
            all turns
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        out: Draw both cuts through the main lobe
        write: Write the antenna to a file: its two cuts (.msi, .pln) or its horizontal one
            (.csv)
    """
    flags: dict[str, Any] = {
        "learn": learn,
        "truth": truth,
        "bearing-deg": bearing_deg,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "out": out,
        "write": write,
    }
    return _program.command(["antenna", antenna], flags)


def pulses(
    *files: Path,
    csv: bool = False,
    rate_hz: float | None = None,
    center_hz: float | None = None,
    format: Path | float | None = None,
    band_hz: Path | float | None = None,
    width_ms: float | Sequence[float] | None = None,
    false_alarms_per_hour: float | None = None,
    full_scale_dbm: float | None = None,
    fold: int | None = None,
    interval_s: Path | float | None = None,
    drift_hz_per_s: float | None = None,
) -> Any:
    """Find the pulses in recorded samples: ``foxhunt pulses``.

    Searches complex samples for pulses of any frequency, and of widths between 2.5 and 40 ms
    unless others are given, at the rate of false alarms that you allow. Reads raw samples (.cu8
    of an RTL-SDR, .cs8, .cs16, .cf32), SigMF and its archives, WAV with two channels (also RF64
    and W64), recordings of SDRangel and gqrx, and raw samples on standard input. Files may be
    longer than the memory. With --fold it finds tags whose single pulses are too weak: it adds
    up the energies of several at every start, interval, frequency and drift.

    Args:
        files: Files of samples; - for standard input
        csv: Print each pulse as soon as it is found, as CSV
        rate_hz: Samples per second of raw samples; files with a header have their own
        center_hz: The centre frequency in hertz; without it frequencies are about the middle,
            unless the file has it
        format: The format of raw samples, if the extension does not give it: cu8, cs8, cs16,
            cf32
        band_hz: The lowest and the highest frequency to search, in hertz [default: the whole
            band]
        width_ms: The widths of pulses in milliseconds, searched at once [default:
            2.5,5,10,20,40, or 20 with --fold]
        false_alarms_per_hour: The number of pulses per hour that noise alone may give [default:
            1]
        full_scale_dbm: The power of a full-scale tone in dBm; without it levels are in dB of
            full scale
        fold: Add up this many pulses before each decision, and find trains of pulses; usually 5
            to 10
        interval_s: The interval of the trains in seconds, or the shortest and the longest; run
            time grows with the range [default: 0.5,3]
        drift_hz_per_s: The largest drift of a carrier, up or down, in hertz per second [default:
            1]
    """
    flags: dict[str, Any] = {
        "csv": csv,
        "rate-hz": rate_hz,
        "center-hz": center_hz,
        "format": format,
        "band-hz": band_hz,
        "width-ms": width_ms,
        "false-alarms-per-hour": false_alarms_per_hour,
        "full-scale-dbm": full_scale_dbm,
        "fold": fold,
        "interval-s": interval_s,
        "drift-hz-per-s": drift_hz_per_s,
    }
    return _program.command(["pulses", *files], flags)


def tags(
    pulses: Path,
    *,
    tags: Path | None = None,
    csv: bool = False,
    intervals_s: Path | float | None = None,
    interval_tolerance: float | None = None,
    frequency_sigma_hz: float | None = None,
    frequency_tolerance_hz: float | None = None,
) -> Any:
    """Assign recorded pulses to tags: ``foxhunt tags``.

    Finds the trains of pulses in a list that a detector wrote: known tags of a table by the gaps
    of their bursts or by frequency, width and interval, and unknown ones by the interval they
    show. Reads the lists of `foxhunt pulses --csv`, SensorGnome and pyradiotracking.

    Args:
        pulses: A list of pulses: CSV with named columns
        tags: A table of known tags: CSV with the columns name, interval_s and optionally
            frequency_hz, width_s, gaps_ms, other_interval_s; or one of SensorGnome
        csv: Print each pulse with the names of its tags, as CSV
        intervals_s: The shortest and the longest interval of unknown tags, in seconds [default:
            0.2,5]
        interval_tolerance: The tolerance of intervals, as a share of the table's [default: 0.01]
        frequency_sigma_hz: The standard deviation of a pulse's measured frequency, in hertz
            [default: 30]
        frequency_tolerance_hz: The standard deviation of carriers about the table's frequencies,
            in hertz [default: 100]
    """
    flags: dict[str, Any] = {
        "tags": tags,
        "csv": csv,
        "intervals-s": intervals_s,
        "interval-tolerance": interval_tolerance,
        "frequency-sigma-hz": frequency_sigma_hz,
        "frequency-tolerance-hz": frequency_tolerance_hz,
    }
    return _program.command(["tags", pulses], flags)


def convert(
    *files: Path,
    pose_topic: Path | float | None = None,
    rssi_topic: Path | float | Sequence[Path | float] | None = None,
    most_gap_s: float | None = None,
    poses: Path | None = None,
    clock_offset: float | None = None,
    clock_within_s: float | None = None,
    calibrated: bool = False,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
) -> Any:
    """Convert recordings to the program's own format: ``foxhunt convert``.

    Reads recordings of any format that `locate` and `bearing` read, and writes them as one CSV
    with the columns of docs/recordings.md: degrees of WGS84 or local metres, angles clockwise
    from true North, seconds or UTC. A bag of ROS 2 (.mcap or .db3) is read by its topics: levels
    (`std_msgs/Float32`, `Float64`) where the receiver was then (`geometry_msgs/PoseStamped`,
    `nav_msgs/Odometry`, `sensor_msgs/NavSatFix`), or foxhunt's own receptions. With --poses it
    reads pulses, as `pulses --csv` and `tags --csv` print them, and joins each with the pose at
    its time.

    Args:
        files: Recordings or one bag, and at last the file that is written
        pose_topic: The topic with the receiver's places, where a bag has several
        rssi_topic: A topic with levels in dBm, and the name of its beacon; again for each more
        most_gap_s: Greatest time between the places before and after a level or pulse, in
            seconds [default: 2]
        poses: Places of the receiver and directions of its antenna: CSV with time_s or time_utc,
            places, heading_deg_compass, pitch_deg, roll_deg, boresight_deg_compass
        clock_offset: Seconds by which the clock of the poses is ahead of that of the pulses, or
            the time in UTC at which the pulses' clock showed 0 [default: 0]
        clock_within_s: Find the clocks' offset from levels and boresights, within this many
            seconds of --clock-offset; refused where they do not show it
        calibrated: The levels of the pulses are in dBm, not in dB of full scale
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
    """
    flags: dict[str, Any] = {
        "pose-topic": pose_topic,
        "rssi-topic": rssi_topic,
        "most-gap-s": most_gap_s,
        "poses": poses,
        "clock-offset": clock_offset,
        "clock-within-s": clock_within_s,
        "calibrated": calibrated,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
    }
    return _program.command(["convert", *files], flags)


def replay(
    log: Path,
    *,
    estimator: EstimatorName | None = None,
    smooth: bool = False,
    ignore: Path | None = None,
    report: Path | None = None,
    tiles: Path | None = None,
    export: Path | Sequence[Path] | None = None,
    origin: Place | None = None,
    start_utc: float | None = None,
) -> Result:
    """Run a log through an estimator again: ``foxhunt replay``.

    Runs every reception of a log through the estimator that the log was made with, and checks
    whether each estimate is the same to the bit; or through another estimator, and compares the
    two on the same flight.

    Args:
        log: A log, such as `foxhunt hunt` writes it
        estimator: Another estimator than the log's own These are the names to choose from;
            `foxhunt list estimators --all` has more.
        smooth: Smooth each beacon's track: its place at the time of each reception, from all
            receptions before and after
        ignore: A list of receptions to leave out: saved by a page, or your own JSON lines
            (docs/report.md)
        report: Write a page for any browser: one file, without a network
        tiles: A map below the page, from tiles on this computer: a folder with z/x/y.png, or an
            .mbtiles or .pmtiles file of images; the page brings the tiles about the places along
        export: Write places, bearings, ellipses, regions and paths to a file, in the format of
            its ending: .geojson, .kml, .czml, .gpx, .csv, .cot (Cursor on Target) or .mcap; or
            the probability of each cell as .tif (GeoTIFF), .kmz (overlay), .mbtiles or .png; may
            be given several times
        origin: The place of the local origin on Earth (WGS84), for --export, --tiles, --cot,
            --mqtt and programs that fetch a hunt from --live, if it is not known
        start_utc: The UTC of the time 0, for --export, if it is not known
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "smooth": smooth,
        "ignore": ignore,
        "report": report,
        "tiles": tiles,
        "export": export,
        "origin": origin,
        "start-utc": start_utc,
    }
    result: Result = _program.command(["replay", log], flags)
    return result


def listen(
    source: Path,
    *,
    csv: bool = False,
    rate_hz: float | None = None,
    center_hz: float | None = None,
    format: Path | float | None = None,
    band_hz: Path | float | None = None,
    width_ms: float | Sequence[float] | None = None,
    false_alarms_per_hour: float | None = None,
    full_scale_dbm: float | None = None,
    gain_db: float | None = None,
    ppm: int | None = None,
    tags: Path | None = None,
    intervals_s: Path | float | None = None,
    for_s: float | None = None,
) -> Any:
    """Show tags as they pulse: from a receiver, a file or a pipe: ``foxhunt listen``.

    Searches samples as they come for pulses, and gives the pulses to tags. On a terminal there
    are a waterfall and a table of tags; elsewhere a line for each pulse, and the table at the
    end. Reads `rtl_tcp` (tcp:HOST:PORT) and receivers of `SoapySDR` (soapy:driver=...), which it
    sets, files of samples, and raw samples on standard input. Ends with Ctrl-C.

    Args:
        source: The source of samples: tcp:HOST:PORT of rtl_tcp, soapy:ARGUMENTS of `SoapySDR`, a
            file, or - for standard input
        csv: Print each pulse as soon as it is found, as CSV
        rate_hz: Samples per second of raw samples; files with a header have their own
        center_hz: The centre frequency in hertz; without it frequencies are about the middle,
            unless the file has it
        format: The format of raw samples, if the extension does not give it: cu8, cs8, cs16,
            cf32
        band_hz: The lowest and the highest frequency to search, in hertz [default: the whole
            band]
        width_ms: The widths of pulses in milliseconds, searched at once [default:
            2.5,5,10,20,40, or 20 with --fold]
        false_alarms_per_hour: The number of pulses per hour that noise alone may give [default:
            1]
        full_scale_dbm: The power of a full-scale tone in dBm; without it levels are in dB of
            full scale
        gain_db: The receiver's gain, in dB; only for tcp: and soapy:
        ppm: The receiver's frequency error in parts per million [default: 0]; only for tcp: and
            soapy:
        tags: A table of known tags, as `foxhunt tags` reads it
        intervals_s: The shortest and the longest interval of unknown tags, in seconds [default:
            0.2,5]
        for_s: End after this time, in seconds
    """
    flags: dict[str, Any] = {
        "csv": csv,
        "rate-hz": rate_hz,
        "center-hz": center_hz,
        "format": format,
        "band-hz": band_hz,
        "width-ms": width_ms,
        "false-alarms-per-hour": false_alarms_per_hour,
        "full-scale-dbm": full_scale_dbm,
        "gain-db": gain_db,
        "ppm": ppm,
        "tags": tags,
        "intervals-s": intervals_s,
        "for-s": for_s,
    }
    return _program.command(["listen", source], flags)


def judge(
    *files: Table,
    truth: Place | None = None,
    against: Path | float | Sequence[Path | float] | None = None,
    calibrate: Path | None = None,
    estimator: EstimatorName2 | None = None,
    p0_dbm: Path | float | None = None,
    exponent: Path | float | None = None,
    target_up_m: Path | float | None = None,
    receiver_antenna: Path | float | None = None,
    transmitter_antenna: Path | float | None = None,
    margin_m: float | None = None,
    receiver_sigma_m: float | None = None,
    reference_m: Path | float | None = None,
    seed: int | None = None,
    terrain: Path | None = None,
    up_from: Literal["ground", "take-off"] | None = None,
    frequency_mhz: float | None = None,
    calibration: Path | None = None,
    conformal: Path | None = None,
    site: Path | float | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
) -> Result:
    """Judge estimators on recordings whose transmitter's place is known: ``foxhunt judge``.

    Locates each beacon of each recording by itself and compares the place with the truth: error,
    NEES, and the share of 95 % ellipses that hold it, for an estimator and for baselines. The
    truth takes part in no fix.

    Args:
        files: Recordings: CSV with named columns; each beacon of each recording is one fix
        truth: The place of the transmitter of all recordings in degrees (WGS84) [default: the
            recordings' own truth]
        against: The baselines, by name [default: for levels `strongest` and `least-absolute`,
            for bearings `lenth1981` and `pseudolinear`]
        calibrate: Write the distances of the truths from the places, in units of the ellipses,
            for --conformal of `locate` and `judge`; needs 19 fixes
        estimator: The estimator (`foxhunt list estimators` describes them); chosen by what was
            recorded unless given These are the names to choose from; `foxhunt list estimators
            --all` has more.
        p0_dbm: The power at one metre in dBm, or `free` where it is not known; needs --exponent
            [default: free]
        exponent: The path-loss exponent, or `free` where it is not known [default: free]
        target_up_m: Height of the transmitter above the ground in metres, or `free` where it is
            not known [default: 0; free for receivers that fly, if the estimator can estimate it]
        receiver_antenna: The receiver's antenna, whose vertical pattern the levels follow: a
            name or a file as for --antenna; where neither antenna is named, `shadowing-grid`
            infers what the levels lose at steep angles, and the others take them for isotropic
        transmitter_antenna: The transmitter's antenna, upright; isotropic unless given
        margin_m: Width of the margin searched around the area that was flown over, in metres;
            the default estimators of levels alone and of bearings alone begin with it, and widen
            it as needed [default: 200]
        receiver_sigma_m: Standard deviation of the receiver's own place on each axis, in metres,
            as its GNSS states it, for rows without receiver_sigma_m; unless given, 3 m for
            places in degrees, and places in metres are known
        reference_m: Place of the reference receiver of range and level differences, in metres of
            the local frame
        seed: The seed of estimators that draw random numbers [default: 1]
        terrain: Correct levels for the loss over the terrain in this folder's tiles: .hgt, or
            GeoTIFF in degrees (docs/terrain.md). Needs an estimator that takes levels in the
            order of time [default: `particle`]
        up_from: The zero of the recordings' heights; heights above the ellipsoid (alt_m) need
            `take-off` [default: ground]
        frequency_mhz: The transmitter's frequency, for the loss over the terrain [default: 2440]
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        conformal: Show a second region, which holds the transmitter with 95 % by your own
            recordings: the factors that `judge --calibrate` wrote
        site: The receiver's surroundings: open, forest, street, indoors or unknown; part of the
            σ of bearings from uncalibrated turns [default: unknown, which is wide]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
    """
    flags: dict[str, Any] = {
        "truth": truth,
        "against": against,
        "calibrate": calibrate,
        "estimator": estimator,
        "p0-dbm": p0_dbm,
        "exponent": exponent,
        "target-up-m": target_up_m,
        "receiver-antenna": receiver_antenna,
        "transmitter-antenna": transmitter_antenna,
        "margin-m": margin_m,
        "receiver-sigma-m": receiver_sigma_m,
        "reference-m": reference_m,
        "seed": seed,
        "terrain": terrain,
        "up-from": up_from,
        "frequency-mhz": frequency_mhz,
        "calibration": calibration,
        "conformal": conformal,
        "site": site,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
    }
    result: Result = _program.command(["judge", *files], flags)
    return result


def compare_estimators(
    trial: Path,
    *,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    estimator: EstimatorName | Sequence[EstimatorName] | None = None,
) -> Any:
    """Compare estimators on drawn bearings: ``foxhunt compare estimators``.

    Draws bearings on a target of known course from a stated density, and prints the errors at
    the end and at the trial's checkpoints, with the posterior Cramér-Rao bound where there is
    one. Nothing flies.

    Args:
        trial: A built-in trial (`foxhunt list trials`) or a TOML file
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        estimator: An estimator; may be repeated [default: the trial's own] These are the names
            to choose from; `foxhunt list estimators --all` has more.
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "estimator": estimator,
    }
    return _program.command(["compare", "estimators", trial], flags)


def compare_extractors(
    case: CaseName | None = None,
    *,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    extractor: ExtractorName | Sequence[ExtractorName] | None = None,
    antenna: Path | float | None = None,
) -> Any:
    """Compare extractors on simulated turns of the antenna: ``foxhunt compare extractors``.

    Draws turns with the noise, the losses or the reflection of a case. Every extractor reads the
    same turns; prints the errors of the bearings, and whether their σ is as large as the errors.

    Args:
        case: The case that turns are drawn from (`foxhunt list cases` describes them) [default:
            bearing-clean]
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        extractor: An extractor; may be repeated [default: all]
        antenna: The antenna of the turns, also for extractors that take one: reference-patch,
            isotropic, dipole, cardioid, patch, yagi, or a file (msi, pln, csv)
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "extractor": extractor,
        "antenna": antenna,
    }
    return _program.command(["compare", "extractors", case], flags)


def compare_antennas(
    scenario: Path | None = None,
    *,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    estimator: EstimatorName | Sequence[EstimatorName] | None = None,
    planner: PlannerName | None = None,
    source: Path | float | None = None,
    dynamics: Literal["isaacs2014", "rigid-body"] | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    components: Literal["both", "rss", "bearing"] | None = None,
    prior_sigma_m: float | None = None,
    power_sigma_db: float | None = None,
    bearing_sigma_deg: float | None = None,
    lag_s: float | None = None,
    calibration: Path | None = None,
) -> Any:
    """Compare antennas in flown hunts: ``foxhunt compare antennas``.

    Flies a scenario with an omnidirectional antenna, with a directional one on a body that
    turns, and with one on a stepper, and compares the errors run by run.

    Args:
        scenario: A built-in scenario (`foxhunt list scenarios`) or a TOML file [default:
            pritzl-6.1]
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        estimator: An estimator; may be repeated [default: the scenario's own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        planner: The planner (`foxhunt list planners` describes them) [default: the scenario's
            own]
        source: The source that all drones listen with (`foxhunt list sources`) [default: the
            scenario's own]
        dynamics: The equations of motion of a scenario's quadrotors [default: the scenario's
            own]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        components: The components of a reception that it uses
        prior_sigma_m: The prior σ of each coordinate of a beacon about the formation's start, in
            metres
        power_sigma_db: The prior σ of the reference power in dB, which is then estimated along
            with the place; 0 if it is known
        bearing_sigma_deg: A σ in degrees added in squares to that of each bearing, for errors
            that no turn shows, such as turned patterns
        lag_s: Fuse receptions at their own time if they come at most this many seconds late
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "estimator": estimator,
        "planner": planner,
        "source": source,
        "dynamics": dynamics,
        "extractor": extractor,
        "antenna": antenna,
        "components": components,
        "prior-sigma-m": prior_sigma_m,
        "power-sigma-db": power_sigma_db,
        "bearing-sigma-deg": bearing_sigma_deg,
        "lag-s": lag_s,
        "calibration": calibration,
    }
    return _program.command(["compare", "antennas", scenario], flags)


def compare_planners(
    *scenarios: Path,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    planner: PlannerName | Sequence[PlannerName] | None = None,
    estimator: EstimatorName | None = None,
    markdown: bool = False,
    source: Path | float | None = None,
    dynamics: Literal["isaacs2014", "rigid-body"] | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    components: Literal["both", "rss", "bearing"] | None = None,
    prior_sigma_m: float | None = None,
    power_sigma_db: float | None = None,
    bearing_sigma_deg: float | None = None,
    lag_s: float | None = None,
    calibration: Path | None = None,
) -> Any:
    """Compare planners in flown hunts: ``foxhunt compare planners``.

    Flies every scenario with every planner, and compares each planner with the reference's, run
    by run: the time until the 95 % ellipse's semi-major axis is below 3 m, the path and the
    errors.

    Args:
        scenarios: Built-in scenarios (`foxhunt list scenarios`) or TOML files [default:
            pritzl-6.1, far-start, three-beacons, one-drone]
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        planner: A planner to compare with pritzl2018; may be repeated [default: all]
        estimator: The estimator [default: each scenario's own] These are the names to choose
            from; `foxhunt list estimators --all` has more.
        markdown: Print two tables in Markdown, for documents: their rows are as wide as they
            need
        source: The source that all drones listen with (`foxhunt list sources`) [default: the
            scenario's own]
        dynamics: The equations of motion of a scenario's quadrotors [default: the scenario's
            own]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        components: The components of a reception that it uses
        prior_sigma_m: The prior σ of each coordinate of a beacon about the formation's start, in
            metres
        power_sigma_db: The prior σ of the reference power in dB, which is then estimated along
            with the place; 0 if it is known
        bearing_sigma_deg: A σ in degrees added in squares to that of each bearing, for errors
            that no turn shows, such as turned patterns
        lag_s: Fuse receptions at their own time if they come at most this many seconds late
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "planner": planner,
        "estimator": estimator,
        "markdown": markdown,
        "source": source,
        "dynamics": dynamics,
        "extractor": extractor,
        "antenna": antenna,
        "components": components,
        "prior-sigma-m": prior_sigma_m,
        "power-sigma-db": power_sigma_db,
        "bearing-sigma-deg": bearing_sigma_deg,
        "lag-s": lag_s,
        "calibration": calibration,
    }
    return _program.command(["compare", "planners", *scenarios], flags)


def compare_sigmas(
    scenario: Path | None = None,
    *,
    runs: int,
    jobs: int | None = None,
    seed: int | None = None,
    quiet: bool = False,
    estimator: EstimatorName | Sequence[EstimatorName] | None = None,
    planner: PlannerName | None = None,
    source: Path | float | None = None,
    dynamics: Literal["isaacs2014", "rigid-body"] | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    components: Literal["both", "rss", "bearing"] | None = None,
    prior_sigma_m: float | None = None,
    power_sigma_db: float | None = None,
    bearing_sigma_deg: float | None = None,
    lag_s: float | None = None,
    calibration: Path | None = None,
    constant_deg: float | None = None,
) -> Any:
    """Compare the σ of bearings in flown hunts: ``foxhunt compare sigmas``.

    Flies a scenario with the σ that the extractor reads from each pattern, with that σ scaled to
    the size of the errors, and with a constant σ, and compares the errors run by run. Prints the
    correlation of σ with the errors of the bearings as well.

    Args:
        scenario: A built-in scenario (`foxhunt list scenarios`) or a TOML file [default:
            pritzl-6.1]
        runs: The number of runs of each contender
        jobs: The number of runs at the same time [default: the number of processors]; the result
            does not depend on it
        seed: The seed of the first run; run i has this plus i [default: 1]
        quiet: Print no progress on standard error
        estimator: An estimator; may be repeated [default: the scenario's own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        planner: The planner (`foxhunt list planners` describes them) [default: the scenario's
            own]
        source: The source that all drones listen with (`foxhunt list sources`) [default: the
            scenario's own]
        dynamics: The equations of motion of a scenario's quadrotors [default: the scenario's
            own]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        components: The components of a reception that it uses
        prior_sigma_m: The prior σ of each coordinate of a beacon about the formation's start, in
            metres
        power_sigma_db: The prior σ of the reference power in dB, which is then estimated along
            with the place; 0 if it is known
        bearing_sigma_deg: A σ in degrees added in squares to that of each bearing, for errors
            that no turn shows, such as turned patterns
        lag_s: Fuse receptions at their own time if they come at most this many seconds late
        calibration: The file that `foxhunt calibrate --out` wrote: path loss, errors of
            bearings, a station's antennas
        constant_deg: The constant σ in degrees [default: the root mean square error of the
            bearings]
    """
    flags: dict[str, Any] = {
        "runs": runs,
        "jobs": jobs,
        "seed": seed,
        "quiet": quiet,
        "estimator": estimator,
        "planner": planner,
        "source": source,
        "dynamics": dynamics,
        "extractor": extractor,
        "antenna": antenna,
        "components": components,
        "prior-sigma-m": prior_sigma_m,
        "power-sigma-db": power_sigma_db,
        "bearing-sigma-deg": bearing_sigma_deg,
        "lag-s": lag_s,
        "calibration": calibration,
        "constant-deg": constant_deg,
    }
    return _program.command(["compare", "sigmas", scenario], flags)


def results(
    file: Path,
    *,
    estimator: Path | float | Sequence[Path | float] | None = None,
    planner: Path | float | None = None,
    scenario: Path | float | None = None,
    beacon: Path | float | None = None,
    seeds: Path | float | None = None,
    compare: Path | float | Sequence[Path | float] | None = None,
    parquet: Path | None = None,
    svg: Path | None = None,
    report: Path | None = None,
    log_of: int | None = None,
    log: Path | None = None,
) -> pd.DataFrame:
    """Summarise, compare and export the runs of a store: ``foxhunt results``.

    Prints the tables of the campaigns that `campaign --store` has kept in a file. Compares two
    contenders seed by seed, and writes runs as tables for other programs. `results merge` puts
    the shards of a campaign together.

    Returns the runs of a store as a data frame with one row for each run, contender and beacon,
    sorted by them. ``run("results", file)`` gives the summary instead, and ``run("results", file,
    "--compare", "ekf", "ukf")`` a comparison.

    >>> import os, tempfile
    >>> store = os.path.join(tempfile.mkdtemp(), "runs.sqlite")
    >>> summary = run("campaign", "one-drone", runs=3, estimator=["ekf", "ukf"], store=store)
    >>> results(store, estimator="ekf").seed.to_list()
    [1, 2, 3]

    Args:
        file: A file that `campaign --store` wrote
        estimator: Only this estimator; may be repeated; `NAME@DIGEST` if several have the name
        planner: Only campaigns with this planner
        scenario: Only campaigns of this scenario
        beacon: Only this beacon
        seeds: Only these seeds, the last one included
        compare: Compare two estimators seed by seed instead
        parquet: Write the runs as Parquet
        svg: Draw the distributions of the errors and the NEES of one beacon, as SVG
        report: Write a page: tables, distributions, and the first estimator compared with the
            others
        log_of: Write the log of the run with this seed; it must be kept (`campaign
            --store-logs`)
        log: The file of the log
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "planner": planner,
        "scenario": scenario,
        "beacon": beacon,
        "seeds": seeds,
        "compare": compare,
        "parquet": parquet,
        "svg": svg,
        "report": report,
        "log-of": log_of,
        "log": log,
    }
    return _program.results(file, flags)


def results_merge(
    *shards: Path,
    to: Path,
) -> Any:
    """Put the shards of a campaign together: ``foxhunt results merge``.

    The new file holds what one process would have written, row by row. Shards of another
    version, scenario, planner or estimator are refused.

    Args:
        shards: The files of the shards
        to: The file to make
    """
    flags: dict[str, Any] = {
        "to": to,
    }
    return _program.command(["results", "merge", *shards], flags)


def plot_trajectory(
    log: Path,
    *,
    out: Path | float,
    estimator: EstimatorName | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The drones, their bearings, and the estimates of a hunt: ``foxhunt plot trajectory``.

    Args:
        log: A log, such as `foxhunt hunt` writes it
        estimator: Replay the logs through this estimator [default: their own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        beacon: The beacon, if a hunt has several [default: all]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "trajectory", log], flags)


def plot_error(
    *logs: Path,
    out: Path | float,
    estimator: EstimatorName | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The error of the estimate after each reception: ``foxhunt plot error``.

    Args:
        logs: Logs, such as `foxhunt hunt` writes them
        estimator: Replay the logs through this estimator [default: their own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        beacon: The beacon, if a hunt has several [default: all]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "error", *logs], flags)


def plot_axes(
    *logs: Path,
    out: Path | float,
    estimator: EstimatorName | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The semi-axes of the 95 % ellipse after each reception: ``foxhunt plot axes``.

    Args:
        logs: Logs, such as `foxhunt hunt` writes them
        estimator: Replay the logs through this estimator [default: their own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        beacon: The beacon, if a hunt has several [default: all]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "axes", *logs], flags)


def plot_nees(
    *logs: Path,
    out: Path | float,
    estimator: EstimatorName | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The NEES after each reception, averaged over logs of one scenario, with its χ² band:
    ``foxhunt plot nees``.

    Args:
        logs: Logs, such as `foxhunt hunt` writes them
        estimator: Replay the logs through this estimator [default: their own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        beacon: The beacon, if a hunt has several [default: all]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "nees", *logs], flags)


def plot_cloud(
    log: Path,
    *,
    out: Path | float,
    estimator: EstimatorName | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The cloud of a particle filter at six moments of a hunt: ``foxhunt plot cloud``.

    Args:
        log: A log, such as `foxhunt hunt` writes it
        estimator: Replay the logs through this estimator [default: their own] These are the
            names to choose from; `foxhunt list estimators --all` has more.
        beacon: The beacon, if a hunt has several [default: all]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "cloud", log], flags)


def plot_pattern(
    file: Path,
    *,
    out: Path | float,
    turn: int | None = None,
    over_angle: bool = False,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The radiation pattern of a recorded turn, as received and preprocessed: ``foxhunt plot
    pattern``.

    Args:
        file: A recording of turns: CSV with named columns
        turn: The number of the turn, from 1 in the order of the recording [default: 1]
        over_angle: Draw the level over the angle, with the mean of each position, the moving
            mean, the border 2 dB below its top, and the detected and the true direction
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "turn": turn,
        "over-angle": over_angle,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "pattern", file], flags)


def plot_levels(
    file: Path,
    *,
    out: Path | float,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The received levels over time, by receiver: ``foxhunt plot levels``.

    Args:
        file: A recording: CSV with named columns
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "levels", file], flags)


def plot_rssi(
    *files: Path,
    out: Path | float,
    truth: Place | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The level over the distance to a known transmitter, by height, with the fitted path loss:
    ``foxhunt plot rssi``.

    Args:
        files: Recordings (CSV with named columns), or logs of simulated hunts (.jsonl)
        truth: The place of the transmitter in degrees (WGS84) [default: the recordings' own
            truth]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "truth": truth,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "rssi", *files], flags)


def plot_bearing_errors(
    *files: Path,
    out: Path | float,
    truth: Place | None = None,
    extractor: ExtractorName | None = None,
    antenna: Path | float | None = None,
    format: Path | float | None = None,
    columns: Path | float | Sequence[Path | float] | None = None,
    sheet: Path | float | None = None,
    level: Path | float | None = None,
    beacon: Path | float | None = None,
    time_format: Path | float | None = None,
    tz: Path | float | None = None,
    utm_zone: Path | float | None = None,
    strict: bool = False,
    negate_levels: bool = False,
    north: Path | float | None = None,
    date: Path | float | None = None,
    positions: int | None = None,
    floor_dbm: float | None = None,
    ceiling_dbm: float | None = None,
    rover: Path | None = None,
    clock_offset_s: float | None = None,
    frequency_hz: float | None = None,
    bandwidth_hz: float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The errors of bearings, with the fitted mixture of a normal and outliers: ``foxhunt plot
    bearing-errors``.

    Args:
        files: Recordings (CSV with named columns), or logs of simulated hunts (.jsonl)
        truth: The place of the transmitter in degrees (WGS84) [default: the recordings' own
            truth]
        extractor: The extractor of bearings from turns (`foxhunt list extractors` describes
            them)
        antenna: The antenna that the extractor knows: reference-patch, isotropic, dipole,
            cardioid, patch, yagi, or a file (msi, pln, csv)
        format: The format: the name of one that comes with the program, or a TOML file with a
            column mapping; recognised by the file's header unless given
        columns: The names of the columns of a table without a header, from the first on,
            separated by commas; `-` for a column that is not to be read. Common names will do,
            such as lat,lon,bearing
        sheet: The sheet of a spreadsheet; the first with more than one row unless given
        level: The levels to read of an autopilot's log that is located alone, such as
            RADIO_STATUS.rssi, RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element
            with the level in a GPX track, or the column with the level in a table of places;
            needed where it has several. No file is then taken for a path, but that of --rover
        beacon: The beacon, where the recording holds several
        time_format: Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or
            in March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
        tz: The offset from UTC of dates that state none, such as +02:00, in recordings and in a
            table with their path [default: UTC]
        utm_zone: The zone of UTM of places in metres, with its band or hemisphere, such as 33U
            or "33 north"; they are then read as degrees
        strict: Refuse a file for its first row that cannot be believed, instead of leaving such
            rows out: an unreadable cell, no fix, a place that jumps, a clock that runs back, a
            copy
        negate_levels: Levels are written without their sign: 71 stands for -71 dBm
        north: North from which bearings, headings and boresights are counted: `true`, `magnetic`
            (by the World Magnetic Model on the day of the recording's time_utc or of --date),
            `grid` (of UTM), or a number of degrees east of true North; as the format has it
            unless given
        date: The day of magnetic North, for recordings without time_utc
        positions: The number of positions in a turn of the antenna [default: 128]
        floor_dbm: The receiver's floor, in dBm or dB as the levels are: one at or below it is
            noise, of which estimators of all receptions at once take but that the true one was
            not above it; found by itself where the least levels crowd as noise does
        ceiling_dbm: The receiver's ceiling, as its levels are: at it the receiver is saturated
            and the true level is higher; found by itself where the highest level repeats
        rover: The receiver's path, instead of the recording's own places: a GPX, KML or KMZ
            file, an autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA
            log or a table with dates and places. It may be among the recordings instead
        clock_offset_s: Seconds added to the times of the measurements for the receiver's path:
            `rtl_power` and `hackrf_sweep` write the computer's local time. Or the time in UTC at
            which the recording's clock showed 0. In a table with places of its own, seconds by
            which the clock of the measurements is behind that of the places. Unless given, an
            offset of up to two minutes is found where the levels of one receiver alone show it,
            beside a path in another file or with places of their own; 0 leaves the times as they
            are
        frequency_hz: The beacon's frequency in hertz, for recordings of power over frequency
        bandwidth_hz: Width of the band that is read about --frequency-hz, in hertz; the
            strongest bin in it counts. One bin unless given [default: 0]
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "truth": truth,
        "extractor": extractor,
        "antenna": antenna,
        "format": format,
        "columns": columns,
        "sheet": sheet,
        "level": level,
        "beacon": beacon,
        "time-format": time_format,
        "tz": tz,
        "utm-zone": utm_zone,
        "strict": strict,
        "negate-levels": negate_levels,
        "north": north,
        "date": date,
        "positions": positions,
        "floor-dbm": floor_dbm,
        "ceiling-dbm": ceiling_dbm,
        "rover": rover,
        "clock-offset-s": clock_offset_s,
        "frequency-hz": frequency_hz,
        "bandwidth-hz": bandwidth_hz,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "bearing-errors", *files], flags)


def plot_phases(
    log: Path | None = None,
    *,
    out: Path | float,
    title: Path | float | None = None,
) -> Any:
    """The phases of a search and the signals between them, with the ways that a hunt went:
    ``foxhunt plot phases``.

    Args:
        log: A log, whose hunt is drawn into the machine
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "phases", log], flags)


def plot_planners(
    file: Path,
    *,
    out: Path | float,
    scenario: Path | float | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The comparison of planners that `compare planners --json` printed: ``foxhunt plot planners``.

    Args:
        file: The output of `foxhunt --json compare planners`
        scenario: Only this scenario
        beacon: Only this beacon
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "scenario": scenario,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "planners", file], flags)


def plot_distributions(
    file: Path,
    *,
    out: Path | float,
    estimator: EstimatorName | Sequence[EstimatorName] | None = None,
    planner: PlannerName | None = None,
    scenario: Path | float | None = None,
    beacon: Path | float | None = None,
    title: Path | float | None = None,
) -> Any:
    """The distributions of errors and NEES of the contenders of a store: ``foxhunt plot
    distributions``.

    Args:
        file: A file that `campaign --store` wrote
        estimator: Only this estimator; may be repeated; `NAME@DIGEST` if several have the name
            These are the names to choose from; `foxhunt list estimators --all` has more.
        planner: Only campaigns with this planner
        scenario: Only campaigns of this scenario
        beacon: Only this beacon
        out: The figure: .svg, or with the feature `png` .png
        title: The title above the figure [default: made of the inputs]
    """
    flags: dict[str, Any] = {
        "estimator": estimator,
        "planner": planner,
        "scenario": scenario,
        "beacon": beacon,
        "out": out,
        "title": title,
    }
    return _program.command(["plot", "distributions", file], flags)


def list_(
    what: WhatName,
    *,
    all: bool = False,
) -> Any:
    """List estimators, extractors, planners, sources, scenarios, trials, cases or keys: ``foxhunt
    list``.

    Lists each entry with its name, a description and its source. `foxhunt list estimators` has
    the estimators to choose from, each with when to use it; with `--all` every estimator, with
    the quantities that it uses.

    Args:
        what: The kind of entries
        all: List every estimator, variants and baselines too; --json always does
    """
    flags: dict[str, Any] = {
        "all": all,
    }
    return _program.command(["list", what], flags)


def page(
    *,
    out: Path | None = None,
    installable: bool = False,
) -> Any:
    """Write a page that locates without an installation: ``foxhunt page``.

    The page is one file that works from a disk, without a network. It holds this program as
    WebAssembly: recordings that are dropped on it get the answers and the report page of
    `locate`, `judge`, `bearing`, `pulses` and `replay`. Simulated hunts fly in it, too. On a
    phone it takes levels and bearings in the field. Nothing leaves the computer.

    Args:
        out: The page to write [default: foxhunt.html]
        installable: Also write a service worker beside the page: from a server with https a
            phone can then install the page and open it without a network
    """
    flags: dict[str, Any] = {
        "out": out,
        "installable": installable,
    }
    return _program.command(["page"], flags)


class CampaignOptions(TypedDict, total=False):
    """The keywords of :func:`campaign` beside its runs and seed."""

    quiet: bool
    estimator: EstimatorName | Sequence[EstimatorName] | None
    planner: PlannerName | None
    source: Path | float | None
    dynamics: Literal["isaacs2014", "rigid-body"] | None
    extractor: ExtractorName | None
    antenna: Path | float | None
    components: Literal["both", "rss", "bearing"] | None
    prior_sigma_m: float | None
    power_sigma_db: float | None
    bearing_sigma_deg: float | None
    lag_s: float | None
    calibration: Path | None
    store: Path | None
    store_logs: bool
    shard: Path | float | None
