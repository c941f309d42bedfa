#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/take/take.h"

/// Finds out why almost nothing of a take fits its calibration: tries each assumption about the error on a sample.
namespace mvstudio::triangulate {

/// In the order in which they are believed where several explain a take alike: what users do often, and what is mended by a
/// word, comes first.
enum class Cause {
  kNone,           ///< "as-given"
  kNormalized,     ///< "normalized": coordinates are 0 to 1
  kFlippedY,       ///< "y-from-below": y counts from the lower edge
  kRotated,        ///< "turned": the images of all cameras, or of some in the same way, are rotated by 90, 180 or 270 degrees
  kInverted,       ///< "poses-inverted": the calibration's poses go the other way
  kMirroredPoses,  ///< "poses-mirrored": the calibration is left-handed
  kRates,          ///< "rates": the cameras' frame rates differ
  kTimeOffset,     ///< "time-offset": frame numbers of the cameras do not start at the same time, or clocks drift
  kMirrored,       ///< "mirrored": images are mirrored left to right
  kImageSize,      ///< "image-size": the images are scaled or cropped against the calibrated size, for example 1080 for 1088
  kDistortion,     ///< "distortion": the file states one that the images do not have
  kTermOrder,      ///< "term-order": the distortion's terms are in another order (geometry::OtherTermOrders)
  kExchanged,      ///< "exchanged": two cameras have each other's name
  kMoved,          ///< "moved": the others agree without one camera; only where nothing else is clear
};

/// "as-given", "normalized", …
std::string_view ToString(Cause cause);

/// The offsets of the cameras' clocks are looked for in this many frames in the middle of a take.
inline constexpr size_t kMostClockFrames = 600;

struct CauseOptions {
  double min_score = 0.3;       ///< detections below are left out
  int max_persons = 1;          ///< persons kept
  double sigma_px = 0;          ///< noise of a detection that still fits; 0: 0.5 % of the image diagonal, that of people
                                ///< detectors with a rig calibrated to a few px
  int max_cameras = 8;          ///< the cameras with the most detections are examined
  bool alike = false;           ///< only changes of all cameras alike, and each left out: a tenth of the work
  int max_frames = 48;          ///< sample, spread over the take; a fourth of it selects, the rest gives the figures
  int max_offset_frames = 180;  ///< see SyncOptions
};

/// Fit of a sample of the detections under one assumption.
struct CauseTrial {
  Cause cause = Cause::kNone;
  std::string assumption;  ///< "without distortion", "with cameras a and b exchanged", …
  std::string remedy;      ///< what to do when it holds
  int num_detections = 0;  ///< of the sample, those that could contribute to points; 0: nothing is known
  /// Fraction of these that contribute to a point with three or more views (two, where three cameras almost never see a
  /// joint).
  double carried = 0;
  /// Mean length of their residuals; 4 sigma for larger or missing ones.
  double residual_px = 0;
  /// The residual falls by at least 30 % against the take as given and by 4 standard errors (one sample per frame), and at
  /// least half of the detections fit.
  bool clear = false;
  bool mirrors_people = false;  ///< most people of the sample are mirror images of people under it
  double offset_frames = 0;     ///< of kTimeOffset and kRates: the largest of a camera, without its sign
};

struct CauseReport {
  CauseTrial as_given;
  /// The best of each cause, smallest residual first. Of clear ones within 3 % of the smallest, the first cause in the
  /// order of Cause comes first.
  std::vector<CauseTrial> trials;
  /// One line with figures when the first trial is clear; else empty.
  std::string message;
};

/// Tries each cause alone, with every camera or pair of cameras that it may concern. All are tried on a few frames; the
/// best of each cause on other frames, so that the choice does not bias the figures. Takes some hundred triangulations of
/// the sample.
///
/// `frames` as in TriangulateTake; without motion, or with gaps, time offsets cannot be tested. The result does not depend
/// on the number of threads.
CauseReport RankCauses(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const CauseOptions& options, const RunContext& run = {});

/// Whether the cameras' frame numbers start at the same time, as RankCauses tries it: no trial, or the one of
/// Cause::kTimeOffset or kRates. Little work beside triangulating the take.
CauseReport CheckTiming(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                        const RunContext& run = {});

/// The fraction of detections that fit this rig, on the sample of RankCauses without any change.
CauseTrial FitAsGiven(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                      const RunContext& run = {});

/// Number of joints that `min_views` cameras see in a frame, of at most `max_persons` persons: an upper bound for
/// triangulation.
int NumTriangulable(const DetectedFrame& frame, double min_score, int max_persons, int min_views = 2);

}  // namespace mvstudio::triangulate
