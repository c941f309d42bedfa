#include "dataset/build/joint_numbers.h"

#include <set>

#include "core/error.h"
#include "dataset/footage/first_number.h"

namespace mvstudio::dataset::internal {
namespace {

void CountJointsFrom(int first, const std::string& path, Pose3d* pose) {
  for (JointRow& row : pose->rows) {
    if (row.frame < first)
      throw FormatError(path, "frame " + std::to_string(row.frame),
                        "is before option 'first-frame' " + std::to_string(first) + ", the number of the first frame");
    row.frame -= first;
  }
}

}  // namespace

void NumberJointsAsFrames(const BuildInputs& inputs, Pose3d* pose, std::vector<Notice>* notices) {
  if (inputs.first_frame != 0) return CountJointsFrom(inputs.first_frame, inputs.pose3d, pose);
  std::set<int64_t> numbers;
  for (const JointRow& row : pose->rows) numbers.insert(row.frame);
  std::vector<std::string> footage;
  for (const CameraFootage& camera : inputs.footage) {
    if (camera.timeline) return;
    footage.push_back(camera.path);
  }
  const FirstNumber first = FirstNumberOf(numbers, footage);
  if (first == FirstNumber::kAsFrames) return;
  const std::string begin = "joints are of frames 1 to " + std::to_string(*numbers.rbegin());
  if (first == FirstNumber::kOne) {
    CountJointsFrom(1, inputs.pose3d, pose);
    notices->push_back({"DAT-FIRST",
                        begin + ", and the footage has as many, from 0: frame 1 of the joints was taken for the first one",
                        "the dataset's time steps are the footage's frames"});
  } else {
    notices->push_back({"DAT-FIRST", begin + ", frames of the footage count from 0: frame 1 was taken for the second one",
                        "if the joints' program counts from 1, option 'first-frame' 1 says so"});
  }
}

}  // namespace mvstudio::dataset::internal
