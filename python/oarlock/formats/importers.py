"""`FORMATS`: recordings of other software that `oarlock import` reads, for its verbs, help and docs/import.md."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from oarlock.formats.listing import FileMatch, Listing
    from oarlock.recording.recording import Recording


@dataclass(frozen=True)
class ImportFormat:
    """A format: the module `oarlock.formats.ROOM.NAME` reads it with `read_NAME(path, **options)`.

    The module's ``find_NAME(listing)`` recognises it by names and first bytes (`oarlock.formats.listing`).

    Args:
        name: of the verb and of the module.
        room: the folder of the module, below `oarlock.formats`; empty for none.
        place: what the path is: `FILE`, `FOLDER`, `PLACE` (either of them) or `MAPPING`.
        contents: what the path contains.
        summary: one line of help.
        example: arguments of an example.
        reads: what can be read, for the page.
        options: names of further keywords of the reader; their help is in its docstring.
        suffixes: how its files' names end, in small letters, for the reasons why a file was not recognised.
        is_last_resort: it is asked about files that no other format recognises.
    """

    name: str
    room: str
    place: str
    contents: str
    summary: str
    example: str
    reads: str
    options: tuple[str, ...] = ()
    suffixes: tuple[str, ...] = ()
    is_last_resort: bool = False

    @property
    def title(self) -> str:
        """What the format is, in a few words."""
        return self.contents.rstrip(".")

    @property
    def command(self) -> str:
        """An example of the verb."""
        return f"oarlock import {self.name} {self.example} --out rec"

    @property
    def module(self) -> str:
        """Name of the module that reads it."""
        return ".".join(filter(None, ("oarlock.formats", self.room, self.name)))

    def read(self, path: Path, **options: object) -> Recording:
        """Read a recording.

        Raises:
            DataError: the file is not of this format.
        """
        reader = getattr(import_module(self.module), f"read_{self.name}")
        return cast("Recording", reader(path, **options))

    def find(self, listing: Listing) -> list[FileMatch]:
        """The recordings of this format in a place; none if its module recognises none by content."""
        finder = getattr(import_module(self.module), f"find_{self.name}", None)
        return [] if finder is None else cast("list[FileMatch]", finder(listing))


FORMATS = (
    ImportFormat(
        "apdm",
        "devices",
        "FILE",
        "CSV export or HDF5 file of an APDM (Opal) recording.",
        "Import an APDM export: gyroscope, accelerometer, magnetometer of every sensor.",
        "imuData01.csv",
        "CSV and HDF5 files of APDM (Opal) units",
        suffixes=(".csv", ".h5", ".hdf5"),
    ),
    ImportFormat(
        "csv",
        "",
        "MAPPING",
        "TOML file with the names of files, columns, units and sensors.",
        "Import CSV files described by a mapping file; decimal commas, clock times and epoch milliseconds are read.",
        "mapping.toml",
        "any CSV file, as a mapping file describes it",
        suffixes=(".toml",),
    ),
    ImportFormat(
        "table",
        "table",
        "FILE",
        "A table of text with names of columns.",
        "Import a CSV or TSV file with clear names of columns, without a mapping file.",
        "arm.csv",
        "a CSV or TSV file whose columns have clear names, such as `Shank ACC X (G)` or `thorax_gx`",
        ("accel_unit", "gyro_unit", "mag_unit", "time_unit", "rate_hz", "save_mapping"),
        suffixes=(".csv", ".tsv", ".txt", ".dat", ".sto"),
        is_last_resort=True,
    ),
    ImportFormat(
        "mtmanager",
        "devices",
        "PLACE",
        "Text export of Xsens MT Manager, or the folder with a file for each unit.",
        "Import exports of Xsens MT Manager (MTw, MTi): gyroscope, accelerometer, magnetometer, orientation.",
        "MT_01200454_000-000_00B40DE4.txt --rate-hz 100",
        "text exports of Xsens MT Manager",
        ("trial", "rate_hz", "orientations"),
        suffixes=(".txt", ".csv"),
    ),
    ImportFormat(
        "dot",
        "devices",
        "PLACE",
        "CSV file of a Movella DOT, or the folder with a file for each unit.",
        "Import CSV files of Movella DOT (Xsens DOT): gyroscope, accelerometer, magnetometer, orientation.",
        "1_20250711_200600_086.csv",
        "CSV files of Movella DOT (Xsens DOT)",
        ("trial", "orientations"),
        suffixes=(".csv", ".txt"),
    ),
    ImportFormat(
        "shimmer",
        "devices",
        "PLACE",
        "Calibrated CSV export of Shimmer Consensys, or the folder of a session.",
        "Import exports of Shimmer Consensys: gyroscope, accelerometer, magnetometer.",
        "Session1_Shimmer_40AC_Calibrated_SD.csv --accel WR",
        "calibrated exports of Shimmer Consensys",
        ("trial", "accel"),
        suffixes=(".csv", ".txt", ".dat"),
    ),
    ImportFormat(
        "mvnx",
        "devices",
        "FILE",
        "MVNX export of Xsens MVN.",
        "Import an MVNX export of Xsens MVN: orientations of segments and sensors, magnetic field of sensors.",
        "trial.mvnx",
        "MVNX exports of Xsens MVN: orientations of segments and sensors, accelerometers, magnetic field",
        suffixes=(".mvnx", ".xml"),
    ),
    ImportFormat(
        "sto",
        "devices",
        "FILE",
        "Table of orientations of OpenSim, .sto.",
        "Import a table of orientations of OpenSim (OpenSense): an orientation of each sensor.",
        "orientations.sto",
        "tables of orientations of OpenSim (OpenSense)",
        ("up",),
        suffixes=(".sto",),
    ),
    ImportFormat(
        "dfjimu",
        "datasets",
        "FILE",
        "A recording of dfjimu, .mat.",
        "Import a dfjimu recording: two inertial units on two bodies connected by a ball joint.",
        "data_3D_01.mat",
        "two units on bodies joined by a ball joint",
        suffixes=(".mat",),
    ),
    ImportFormat(
        "diodem",
        "datasets",
        "FOLDER",
        "A trial: the folder with imu_rigid.csv.",
        "Import a DIODEM trial: five inertial units on a chain of five links.",
        "trial1 --mounted foam",
        "five units on a chain of five links",
        ("mounted", "mag_unit_ut"),
    ),
    ImportFormat(
        "openaxes",
        "datasets",
        "FOLDER",
        "The data folder that contains synced_imu.",
        "Import an OpenAXES run: two inertial units on the links of a robot.",
        "openaxes_ur5 --run circle-100",
        "two units on the links of a robot",
        ("run",),
    ),
    ImportFormat(
        "broad",
        "datasets",
        "FILE",
        "A trial of the BROAD data set, .mat.",
        "Import a BROAD trial: one inertial unit with magnetometer.",
        "01_undisturbed_slow_rotation_A.mat",
        "one unit with magnetometer",
        suffixes=(".mat",),
    ),
    ImportFormat(
        "qmt",
        "datasets",
        "FILE",
        "The full-body example of qmt, .mat.",
        "Import the full-body example of qmt: an inertial unit on each of sixteen segments.",
        "full_body_example_data.mat",
        "sixteen units on a person",
        suffixes=(".mat",),
    ),
    ImportFormat(
        "ngimu",
        "devices",
        "FOLDER",
        "Folder of a session, with a folder for each unit.",
        "Import x-io NGIMU units: CSV folders of the vendor's software.",
        "LOG_0000",
        "x-io NGIMU units: folders of CSV files",
        suffixes=(".csv",),
    ),
    ImportFormat(
        "lines",
        "devices",
        "FILE",
        "Lines t_us,seq,ax,ay,az,gx,gy,gz,mx,my,mz.",
        "Import a unit that somebody built, which writes Oarlock's line protocol to a serial port or by UDP.",
        "left_hand.csv",
        "units that you built yourself: Oarlock's line protocol",
        suffixes=(".csv", ".txt", ".log"),
    ),
    ImportFormat(
        "c3d",
        "devices",
        "FILE",
        "C3D file with analogue channels.",
        "Import analogue channels of a C3D file: inertial units by their labels, all other channels as numbers.",
        "trial.c3d",
        "analogue channels of C3D files, inertial units among them",
        suffixes=(".c3d",),
    ),
    ImportFormat(
        "mcap",
        "devices",
        "FILE",
        "MCAP file of ROS 2.",
        "Import inertial units from an MCAP file of ROS 2: messages Imu and MagneticField.",
        "bag.mcap",
        "MCAP files of ROS 2: inertial units and magnetometers",
        suffixes=(".mcap",),
    ),
    ImportFormat(
        "xdf",
        "devices",
        "FILE",
        "XDF file, as LabRecorder writes it.",
        "Import streams of the Lab Streaming Layer: inertial units by their labels, all other channels as numbers.",
        "trial.xdf",
        "XDF files of the Lab Streaming Layer (LSL), all streams",
        suffixes=(".xdf",),
    ),
    ImportFormat(
        "ximu3",
        "devices",
        "PLACE",
        "Folder with the units' folders of CSV files, or a .ximu3 file.",
        "Import x-io x-IMU3 units: CSV folders of the vendor's software, or files of the data logger.",
        "logged_lower_body",
        "x-io x-IMU3 units: folders of CSV files, or .ximu3 files",
        suffixes=(".csv", ".ximu3"),
    ),
)
"""All formats, in the order of the help."""
