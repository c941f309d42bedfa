#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/take/take.h"

/// Why does hardly anything of a take fit its calibration? Each assumption about what is wrong is tried on a sample.
namespace mvstudio::triangulate {

enum class Cause {
  kNone,        ///< "as given"
  kDistortion,  ///< "distortion": the file lists one that the pictures do not have
  kTermOrder,   ///< "term-order": the distortion's terms stand in another order (geometry::OtherTermOrders)
  kImageSize,   ///< "image-size": the pictures are scaled or cropped against the calibrated size, 1080 for 1088 among them
  kTimeOffset,  ///< "time-offset": cameras do not count frames from the same instant
  kExchanged,   ///< "exchanged": two cameras bear each other's name
  kMirrored,    ///< "mirrored": the pictures of a camera are mirrored or upside down
};

/// "as-given", "distortion", …
std::string_view ToString(Cause cause);

struct CauseOptions {
  double min_score = 0.3;       ///< detections below are left out
  int max_persons = 1;          ///< persons kept
  double sigma_px = 0;          ///< noise that a detection that fits may have; 0: 0.5 % of the image diagonal, as that of
                                ///< detectors of people whose rig is calibrated to a few px
  int max_cameras = 8;          ///< those with the most detections are looked at
  int max_frames = 48;          ///< sample, spread over the take; a fourth of it chooses, the rest gives the figures
  int max_offset_frames = 180;  ///< see SyncOptions
};

/// How well a sample of the detections fits under one assumption.
struct CauseTrial {
  Cause cause = Cause::kNone;
  std::string assumption;  ///< "without distortion", "with cameras a and b exchanged", …
  std::string remedy;      ///< what to do when it is true
  int num_detections = 0;  ///< of the sample, that points could carry; 0: nothing is known
  /// Part of these that a point carries, with three views or more; two where three cameras hardly ever see a joint.
  double carried = 0;
  /// Mean over all of them of the residual, 4 sigma where there is none or a larger one.
  double residual_px = 0;
  /// The residual falls by 30 % or more against the take as given and by 4 standard errors (one sample a frame), and at least
  /// half of the detections fit.
  bool clear = false;
};

struct CauseReport {
  CauseTrial as_given;
  /// The best of each cause, smallest residual first; of clear ones within 3 % of the smallest, the first cause of the list
  /// above leads.
  std::vector<CauseTrial> trials;
  /// One line with figures when the first trial is clear; else empty.
  std::string message;
};

/// Tries each cause alone, every camera or pair of cameras that it may concern: on a few frames all of them, on other frames
/// the best of each cause, so that the figures owe nothing to the choice. Costs some hundred triangulations of the sample.
/// `frames` as TriangulateTake takes them; without motion or with gaps there is nothing to be said of time. The result does not
/// depend on the number of threads.
CauseReport RankCauses(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const TakeBody& body,
                       const CauseOptions& options, const RunContext& run = {});

/// The sample of RankCauses as given: what part of the detections fits this rig.
CauseTrial FitAsGiven(const geometry::Rig& rig, const std::vector<DetectedFrame>& frames, const CauseOptions& options,
                      const RunContext& run = {});

/// Joints that `min_views` cameras see in a frame, of at most `max_persons` persons: what triangulation could give at best.
int NumCarriable(const DetectedFrame& frame, double min_score, int max_persons, int min_views = 2);

}  // namespace mvstudio::triangulate
