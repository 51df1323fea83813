"""All formats that `plan export` writes; a new one is a file and a line here."""

from .blender_script import BlenderScript
from .colmap_model import ColmapModel
from .exported_rig import ExportFormat
from .glb_scene import GlbScene
from .mount_tables import MountTables
from .opencv_storage import OpencvStorage
from .ros_files import RosFiles
from .sheets.aim_sheets import AimSheets
from .sheets.rig_drawing import RigDrawing
from .step_file import StepFile
from .usd_stage import UsdStage

FORMATS: tuple[ExportFormat, ...] = (
    OpencvStorage(),
    ColmapModel(),
    GlbScene(),
    BlenderScript(),
    RosFiles(),
    UsdStage(),
    MountTables(),
    StepFile(),
    RigDrawing(),
    AimSheets(),
)
