from armloop.api.diagnosis import Diagnosis as Diagnosis
from armloop.api.diagnosis import diagnose as diagnose
from armloop.api.excitation import Reference as Reference
from armloop.api.excitation import excite as excite
from armloop.api.model import Model as Model
from armloop.api.model import load_model as load_model
from armloop.api.model import reconstruct as reconstruct
from armloop.api.reading import read_log as read_log
from armloop.api.reading import read_logs as read_logs
from armloop.api.score import Comparison as Comparison
from armloop.api.score import Score as Score
from armloop.api.score import evaluate as evaluate
from armloop.api.tracking import Tracking as Tracking
from armloop.api.tracking import track as track
from armloop.data.log import MotionLog as MotionLog
from armloop.data.log import write_log as write_log
from armloop.robot.arm import load_arm as load_arm
from armloop.util.errors import InputError as InputError

__version__: str
__all__: list[str]
