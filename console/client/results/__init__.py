"""The answers of a robot's gateway as frozen values, with units in their names; free of the wire format.

None means "unknown". Enumerations have a member `UNKNOWN`: the gateway did not set the field, or it is newer
than this client and set a value that this client does not know.
"""

from console.client.results.cloud import (
    CloudEvent,
    CloudState,
    CloudStatus,
    RecordingCopyEvent,
    UploadAnswer,
    UploadCancelled,
)
from console.client.results.driving import (
    DriveInhibit,
    DriveLimits,
    DriveOpened,
    DrivePhase,
    DriveState,
    RobotStopped,
    SpeedLimits,
    StopLatch,
    StopReset,
    Supervision,
)
from console.client.results.event import (
    CaughtUp,
    ControlAction,
    ControlResult,
    EncoderFallback,
    Event,
    EventGap,
    EventKind,
    EventPosition,
    GapReason,
    PreviewEvent,
    RecordingEvent,
)
from console.client.results.fault import Fault, FaultSeverity
from console.client.results.overlay import (
    Detection,
    Detections,
    OperatorEvent,
    OverlaySnapshot,
    WatchedStatus,
)
from console.client.results.platform import Battery, Compute, Network, Platform, Power
from console.client.results.pose import FixStatus, Orientation, Position
from console.client.results.preview import (
    Camera,
    CameraState,
    Encoder,
    KeyFrameAnswer,
    PictureDelivery,
    PictureReport,
    PreviewChange,
    PreviewCounters,
    PreviewMeasurement,
    PreviewProfile,
    PreviewState,
    PreviewStatus,
    StreamContainer,
    StreamEndpoint,
    StreamTransport,
    VideoCodec,
    VideoFormat,
)
from console.client.results.recording import (
    ExportChunk,
    ExportHeader,
    RecorderState,
    Recording,
    RecordingAnswer,
    RecordingChange,
    RecordingCopy,
    RecordingCopyState,
    RecordingDeleted,
    RecordingFile,
    RecordingFound,
    RecordingGap,
    RecordingGapCause,
    RecordingKind,
    RecordingPage,
    RecordingPreset,
    RecordingState,
    RecordingStatus,
    RecordingStopReason,
    RecordingThumbnail,
)
from console.client.results.sample import Freshness, Sample, Source, SourceState
from console.client.results.status import (
    EffectiveCommand,
    GatewayFacts,
    GatewayInfo,
    Health,
    HealthState,
    MethodCounts,
    Mission,
    Odometry,
    RobotTime,
    SystemStatus,
    Teleop,
    TeleopAnswer,
    TeleopCommand,
    TeleopState,
    Vision,
)
from console.client.results.value import NumberLevel, NumberValue, TextLevel, TextValue
