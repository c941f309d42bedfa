#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/fields.h"
#include "dataset/panoptic/panoptic.h"

/// Assigns the cameras and frames of a dataset to training, model selection and the final score.
namespace mvstudio::dataset {

inline constexpr char kSplitSchema[] = "mvstudio.split/1";

struct SplitPart {
  std::vector<std::string> cameras;  ///< Panoptic names, sorted
  std::vector<int> frames;           ///< frame numbers, sorted
  bool empty() const { return cameras.empty() || frames.empty(); }
};

/// The part that a camera or an image is in. The numbers are those of packs.
enum class PartOfSplit : uint8_t { kNone, kTrain, kValidation, kTest };

/// "train", "validation", "test"; empty for kNone.
std::string_view ToString(PartOfSplit part);

/// Frames of one uninterrupted motion.
struct MotionBlock {
  int first = 0, last = 0;  ///< frame numbers, both inside
};

/// Training uses train.cameras in train.frames, and so on; camera and frame pairs across the parts are not used.
struct Split {
  std::string dataset;  ///< sequence
  std::string rule;     ///< how it was made, in words: "preset tna-16"
  SplitPart train, validation, test;
  int guard_frames = 0;             ///< frames left out on either side between the parts
  std::vector<int> unused_frames;   ///< of these, and any others in no part
  std::vector<MotionBlock> blocks;  ///< of the whole take
};

/// All violated rules, one line each ("train and test share camera 00_03"). Train and test share neither cameras nor
/// frames. Validation shares no frames with either and no cameras with test. Train and test are not empty; nothing occurs
/// twice.
std::vector<std::string> SplitFaults(const Split& split);

/// `mvstudio.split/1`, JSON. Reading throws IoError, or FormatError naming every camera and frame that is shared; writing
/// throws ContractViolation for a split with faults.
Split ReadSplit(const std::string& path);
void WriteSplit(const Split& split, const std::string& path);
Split SplitFromJsonText(const std::string& text, const std::string& path_for_messages);
std::string SplitToJsonText(const Split& split);

/// Throws FormatError naming cameras and frames that the dataset does not have.
void RequireSplitOf(const Split& split, const PanopticDataset& dataset, const std::string& path_for_messages);

struct SplitOptions {
  std::string preset;
  std::vector<std::string> test_cameras;  ///< Panoptic or studio names
  std::vector<std::string> train_cameras;
  std::vector<std::string> validation_cameras;
  std::vector<int> test_frames;
  std::vector<int> validation_frames;
  int num_train_cameras = 0;  ///< spread evenly around the scene, see SpreadCameras
  int every_camera = 0;       ///< camera k, 2k, … of the rig's order is for test
  double test_share = 0.25;   ///< of the frames, the last ones, when no frames are named
  int guard_frames = 0;
  uint64_t seed = 1;
};

/// A preset's name and a one-line description.
struct SplitPreset {
  std::string name, what;
};
const std::vector<SplitPreset>& SplitPresets();

/// Throws UsageError for names and frames that the dataset does not have, contradictions, and parts that would be empty.
Split MakeSplit(const PanopticDataset& dataset, const SplitOptions& options);

/// Indices of `count` cameras whose directions, seen from `middle_in_world`, are as far apart as possible: farthest-point
/// selection, then exchanges while the sorted list of nearest angles improves. Seed 1 starts at the camera farthest from
/// all others, other seeds at a random one. Sorted and deterministic.
std::vector<int> SpreadCameras(const geometry::Rig& rig, const Eigen::Vector3d& middle_in_world, int count, uint64_t seed = 1);

/// Splits the frames where numbers are missing or the joints jump: by more than 0.15 m on average (median over people) and
/// five times the usual step.
std::vector<MotionBlock> FindMotionBlocks(const PanopticDataset& dataset);

/// The difficulty of a split, to interpret scores on it.
struct SplitReport {
  struct Camera {
    std::string name, nearest_train;
    double angle_deg = 0;  ///< between the two, at the middle of the people
  };
  std::vector<Camera> test_cameras;
  double median_angle_deg = 0, max_angle_deg = 0;
  /// Mean distance of a test pose's joints from those of the most similar training pose, after the best rotation about the
  /// vertical and translation; metres, over the test frames. NaN without poses.
  double median_novelty_m = 0, p90_novelty_m = 0, max_novelty_m = 0;
  double usual_step_m = 0;  ///< the same between neighbouring frames: the level of "not new"
  int train_images = 0, validation_images = 0, test_images = 0;
};
SplitReport DescribeSplit(const PanopticDataset& dataset, const Split& split);

}  // namespace mvstudio::dataset
