#include "dataset/build/first_pass.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "core/error.h"
#include "dataset/footage/frames.h"

namespace mvstudio::dataset::internal {
namespace {

bool HasJoint(const People& people) {
  for (const auto& [id, pose] : people) {
    if (std::any_of(pose.valid.begin(), pose.valid.end(), [](bool v) { return v; })) return true;
  }
  return false;
}

std::string ListText(const std::set<int>& numbers) {
  constexpr size_t kShown = 8;
  std::string text;
  size_t count = 0;
  for (const int number : numbers) {
    if (count++ == kShown) return text + ", … (" + std::to_string(numbers.size()) + " in all)";
    text += (text.empty() ? "" : ", ") + std::to_string(number);
  }
  return text;
}

/// Handles time steps that have joints and no image.
void Settle(const CameraJob& job, const std::set<int>& gaps, const std::set<int>& lost, int count, int64_t last,
            const BuildOptions& options, FootageSamples* samples) {
  if (!lost.empty() && !options.keep_undamaged) {
    throw FormatError(job.footage.path, "frame " + std::to_string(*lost.begin()),
                      "has 3D joints and no image; the footage holds " + std::to_string(count) + " frames, the last is " +
                          std::to_string(last) + ": is it the footage of this take, and whole?" +
                          (lost.size() == 1 && *lost.begin() == count
                               ? " If the joints' program counts frames from 1, option 'first-frame' 1 says so"
                               : ""));
  }
  std::set<int> all = gaps;
  all.insert(lost.begin(), lost.end());
  if (!all.empty() && options.require_complete) {
    throw FormatError(job.footage.path, "time step " + std::to_string(*all.begin()),
                      "has 3D joints and no image: no frame was recorded at the time steps " + ListText(all) +
                          "; without option 'require-complete' these images are left out");
  }
  samples->gaps.assign(all.begin(), all.end());
}

void CheckOrder(const FrameSource& source, const FrameSource::Frame& frame, int64_t last, FootageSamples* samples) {
  const auto [width, height] = source.size_px();
  if (frame.number <= last) RefuseOrder(source.path(), frame.label, frame.number, last);
  if (samples->width == 0) samples->width = width, samples->height = height;
  if (width != samples->width || height != samples->height) {
    throw FormatError(
        source.path(), frame.label,
        "is " + PixelsText(width, height) + ", the ones before are " + PixelsText(samples->width, samples->height));
  }
}

/// The next frame; where damage is not passed over, says how it could be.
std::optional<FrameSource::Frame> NextFrame(const BuildOptions& options, FrameSource* source) {
  if (options.keep_undamaged) return source->Advance();
  try {
    return source->Advance();
  } catch (const FormatError& error) {
    const std::string start = error.path() + (error.where().empty() ? "" : ": " + error.where()) + ": ";
    throw FormatError(error.path(), error.where(),
                      std::string(error.what()).substr(start.size()) + "; option 'keep-undamaged' uses what decodes");
  }
}

}  // namespace

std::string PixelsText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

TimeSteps::TimeSteps(const CameraFootage& footage) {
  if (!footage.timeline) return;
  known_ = true;
  const CameraTimeline* camera = footage.timeline->Find(footage.camera);
  if (!camera) throw FormatError(footage.path, "timeline", "camera " + footage.camera + " is not in the take's timeline");
  for (const auto& [frame, time_step] : TimeStepsOfFrames(*camera)) of_[frame].push_back(static_cast<int>(time_step));
}

std::vector<int> TimeSteps::Of(int64_t number) const {
  if (!known_)
    return number >= 0 && number <= std::numeric_limits<int>::max() ? std::vector<int>{static_cast<int>(number)}
                                                                    : std::vector<int>{};
  const auto found = of_.find(number);
  return found == of_.end() ? std::vector<int>{} : found->second;
}

std::set<int> TimeSteps::WithoutFrame(const std::set<int>& wanted) const {
  std::set<int> without = known_ ? wanted : std::set<int>{};
  for (const auto& [frame, time_steps] : of_) {
    for (const int time_step : time_steps) without.erase(time_step);
  }
  return without;
}

std::set<int> SampleFrames(const std::map<int, People>& poses, int count) {
  std::vector<int> with_joints;
  for (const auto& [frame, people] : poses) {
    if (HasJoint(people)) with_joints.push_back(frame);
  }
  const int n = static_cast<int>(with_joints.size()), k = std::min(std::max(count, 1), n);
  std::set<int> samples;
  for (int i = 0; i < k; ++i) samples.insert(with_joints[size_t(2 * i + 1) * n / (2 * k)]);
  return samples;
}

FootageSamples ReadSamples(const CameraJob& job, const std::set<int>& wanted, const BuildOptions& options) {
  FootageSamples samples;
  std::set<int> missing;
  for (const auto& [frame, people] : *job.poses) missing.insert(frame);
  const TimeSteps time_steps(job.footage);
  const std::set<int> gaps = time_steps.WithoutFrame(missing);
  for (const int gap : gaps) missing.erase(gap);
  auto source = OpenFrames(job.footage.path, {options.keep_undamaged});
  int64_t last = -1;
  int count = 0;
  for (; auto frame = NextFrame(options, source.get()); ++count) {
    CheckOrder(*source, *frame, last, &samples);
    last = frame->number;
    Image image;
    for (const int time_step : time_steps.Of(frame->number)) {
      missing.erase(time_step);
      if (!wanted.count(time_step)) continue;
      if (image.empty()) image = source->FullImage();
      samples.frames.push_back(image);
      samples.time_steps.push_back(time_step);
    }
  }
  Settle(job, gaps, missing, count, last, options, &samples);
  return samples;
}

}  // namespace mvstudio::dataset::internal
