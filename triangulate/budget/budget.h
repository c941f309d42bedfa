#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include "core/progress.h"
#include "geometry/rig/rig.h"
#include "triangulate/sync/sync.h"
#include "triangulate/take/take.h"

/// How much of the error of a take's 3D joints, and of held-out cameras, comes from which stage.
namespace mvstudio::triangulate {

enum class BudgetStage {
  kCalibration,  ///< "calibration": lenses and poses
  kSync,         ///< "synchronisation": time offsets
  kJoints2d,     ///< "2D joints": where a detected joint lies
  kPeople,       ///< "association": who is who, left and right, and people that a camera missed
};
inline constexpr size_t kNumBudgetStages = 4;
inline constexpr BudgetStage kBudgetStages[kNumBudgetStages] = {BudgetStage::kCalibration, BudgetStage::kSync,
                                                                BudgetStage::kJoints2d, BudgetStage::kPeople};
std::string_view ToString(BudgetStage stage);

/// A take as the stages left it.
struct BudgetTake {
  geometry::Rig rig;
  std::vector<DetectedFrame> frames;  ///< by the cameras' own frame numbers, ascending
  std::vector<Clock> clocks;          ///< in the rig's order
  std::vector<double> sigma_frames;   ///< of their offsets; NaN: not stated
  TakeBody body{0};
  TakeOptions options;
};

/// Joints of all people in one time step, metres; nothing where the truth has none.  // [person][joint]
using TruePeople = std::vector<std::vector<std::optional<Eigen::Vector3d>>>;

struct BudgetTruth {
  geometry::Rig rig;                  ///< the same cameras, in the same order
  std::vector<double> offset_frames;  ///< camera c shows in its frame offset + f the time step f
  std::map<int, TruePeople> people;   ///< by time step, in the true rig's world; a person keeps its index
};

/// A part of an error, with the interval that holds 95 % of a seeded bootstrap over blocks of consecutive frames.
struct BudgetShare {
  double share = 0, low = 0, high = 0;
  double alone = 0;  ///< by how much the error falls when this stage alone is made true
};

/// One kind of error: mean distances over what every combination of stages and truths could compute.
struct BudgetMeasure {
  int num = 0;                                       ///< distances averaged
  double now = 0, low = 0, high = 0;                 ///< with all stages as they are
  double rest = 0;                                   ///< with the truth in place of all stages
  std::array<BudgetShare, kNumBudgetStages> stages;  ///< sum of the shares = now - rest
};

/// What the truth says of a camera directly.
struct BudgetCamera {
  std::string name;
  double rotation_deg = 0, centre_mm = 0, lens_px = 0;  ///< lens: mean distance of a ray's two pixels over the image
  double offset_frames = 0;                             ///< stated minus true, about the median of all cameras
  Eigen::Vector2d bias_px = Eigen::Vector2d::Zero();    ///< median of detected minus true
  double noise_px = 0;                                  ///< of a coordinate about it, from the median deviation
  int num_people = 0, num_swapped = 0, num_missed = 0;  ///< people in images: seen, with left and right exchanged, not seen
};

/// The three errors that are divided.
enum class BudgetError { kHeldOut, kJoints, kMissing };

struct ErrorBudget {
  BudgetMeasure joints_mm;            ///< of the 3D joints from the truth
  BudgetMeasure held_out_px;          ///< of a left-out camera's joints from the projection of what the others see
  BudgetMeasure missing;              ///< percent of the joints that all truths together find, without a position
  std::vector<BudgetCamera> cameras;  ///< in the rig's order
  double px_per_mm = 0;               ///< what 1 mm at the joints is in an image, mean of the cameras
  /// A stage with 2 % and more of the joints in `missing`; else the largest share of all in px, those of joints_mm by
  /// px_per_mm.
  BudgetStage next = BudgetStage::kCalibration;
  BudgetError next_by = BudgetError::kHeldOut;
  /// By how much that error falls when the stage is made true in one camera alone.
  std::vector<double> next_by_camera;
  /// Of the camera that brings most, with next = kCalibration: what its true lens alone and its true pose alone bring.
  double lens_alone = 0, pose_alone = 0;

  const BudgetMeasure& Measure(BudgetError error) const {
    return error == BudgetError::kMissing ? missing : error == BudgetError::kJoints ? joints_mm : held_out_px;
  }
};

/// The rig is first moved onto the true one (no scale), and the offsets about their median: neither a world nor a common
/// clock is an error. Substitutes the truth for every set of stages and solves the take with it. Errors as TriangulateTake;
/// num = 0 where nothing is in both.
ErrorBudget MeasureBudget(BudgetTake take, const BudgetTruth& truth, const RunContext& run = {});

}  // namespace mvstudio::triangulate
