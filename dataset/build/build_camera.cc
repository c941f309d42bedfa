#include "dataset/build/build_camera.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/shell_word.h"
#include "dataset/build/build_blocks.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

std::string SizeText(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

bool HasJoint(const People& people) {
  for (const auto& [id, pose] : people) {
    if (std::any_of(pose.valid.begin(), pose.valid.end(), [](bool v) { return v; })) return true;
  }
  return false;
}

/// Frames to learn the background from: evenly spaced among those with joints.
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

struct Samples {
  std::vector<Image> frames;
  std::vector<People> people;
  int width = 0, height = 0;
  std::vector<int> gaps;
};

/// The time steps of a frame of the footage.
class TimeSteps {
 public:
  explicit TimeSteps(const CameraFootage& footage) {
    if (!footage.timeline) return;
    known_ = true;
    const CameraTimeline* camera = footage.timeline->Find(footage.camera);
    if (!camera) throw FormatError(footage.path, "timeline", "camera " + footage.camera + " is not in the take's timeline");
    for (const auto& [frame, time_step] : TimeStepsOfFrames(*camera)) of_[frame].push_back(static_cast<int>(time_step));
  }
  std::vector<int> Of(int64_t number) const {
    if (!known_)
      return number >= 0 && number <= std::numeric_limits<int>::max() ? std::vector<int>{static_cast<int>(number)}
                                                                      : std::vector<int>{};
    const auto found = of_.find(number);
    return found == of_.end() ? std::vector<int>{} : found->second;
  }
  /// Those of `wanted` that the camera has no frame for, as the timeline tells.
  std::set<int> WithoutFrame(const std::set<int>& wanted) const {
    std::set<int> without = known_ ? wanted : std::set<int>{};
    for (const auto& [frame, time_steps] : of_) {
      for (const int time_step : time_steps) without.erase(time_step);
    }
    return without;
  }

 private:
  bool known_ = false;
  std::map<int64_t, std::vector<int>> of_;
};

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
            const BuildOptions& options, Samples* samples) {
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

void CheckOrder(const FrameSource& source, const FrameSource::Frame& frame, int64_t last, Samples* samples) {
  const auto [width, height] = source.size_px();
  if (frame.number <= last) RefuseOrder(source.path(), frame.label, frame.number, last);
  if (samples->width == 0) samples->width = width, samples->height = height;
  if (width != samples->width || height != samples->height) {
    throw FormatError(source.path(), frame.label,
                      "is " + SizeText(width, height) + ", the ones before are " + SizeText(samples->width, samples->height));
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

/// First pass over the footage: all of it must decode, have one size and reach the last frame of the joints.
Samples ReadSamples(const CameraJob& job, const std::set<int>& wanted, const BuildOptions& options) {
  Samples samples;
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
      samples.people.push_back(job.poses->at(time_step));
    }
  }
  Settle(job, gaps, missing, count, last, options, &samples);
  return samples;
}

std::string ScoresText(const std::vector<SizeRule>& rules, const std::vector<double>& scores) {
  std::string text;
  for (size_t i = 0; i < rules.size(); ++i) {
    const std::string number = Format("%.3f", scores[i]);
    text += (i ? ", " : "") + rules[i].name + " " + number;
  }
  return text;
}

SizeDecision MatchSize(const CameraJob& job, const Samples& samples, const BuildOptions& options,
                       std::vector<Notice>* warnings) {
  const geometry::Camera& c = job.camera.camera;
  const auto rules = SizeRules(c.width_px, c.height_px, samples.width, samples.height);
  const std::string sizes =
      "footage is " + SizeText(samples.width, samples.height) + ", the calibration is for " + SizeText(c.width_px, c.height_px);
  if (rules.empty()) {
    const bool rotated = samples.width == c.height_px && samples.height == c.width_px;
    throw FormatError(job.footage.path, "",
                      sizes + (rotated ? ": the footage is turned by a quarter" : ": more than 2 % apart") +
                          "; calibrate at this size or give the footage that was calibrated");
  }
  if (rules.size() == 1) return {rules[0], true, {0}};
  const auto named =
      std::find_if(rules.begin(), rules.end(), [&](const SizeRule& r) { return r.name == ToString(options.size_rule); });
  SizeDecision decision;
  std::string reason;
  if (named != rules.end()) {
    decision = {*named, true, {}};
    reason = "as asked for";
  } else if (samples.frames.empty()) {
    decision = {rules[0], false, {}};
    reason = "without evidence: no frame has joints";
  } else {
    decision = DecideSizeRule(rules, job.camera, samples.frames, samples.people, job.joint_rms_px, options.mask);
    reason = std::string(decision.decisive ? "which the joints fit best"
                                           : "the likeliest of the rules that the joints do not rule out") +
             " (evidence in nats: " + ScoresText(rules, decision.scores) + ")";
  }
  warnings->push_back({"DAT-SIZE",
                       "camera " + job.footage.camera + ": " + sizes + "; taken as '" + decision.rule.name + "', " + reason +
                           ": the dataset's intrinsics follow",
                       "calibrate with footage of the size that is used, or name the rule with option 'size-rule'"});
  return decision;
}

std::string FrameName(const std::string& camera, int frame) { return camera + Format("_%08d", frame); }

void AddToReport(const BodyMask& mask, BuiltCamera* built) {
  built->mean_area_fraction += mask.area_fraction;
  built->joints += mask.joints;
  built->joints_on_mask += mask.joints_on_mask;
  built->joints_supported += mask.joints_supported;
}

double AreaFraction(const Image& mask) {
  double sum = 0;
  for (const uint8_t value : mask.pixels) sum += value;
  return sum / (255.0 * static_cast<double>(mask.pixels.size()));
}

/// Second pass: images and masks of the time steps that have joints, block after block.
class FrameWriter {
 public:
  FrameWriter(const CameraJob& job, const geometry::RigCamera& camera, const CameraMaskModel* model,
              const BuildOptions& options)
      : job_(job), camera_(camera), model_(model), options_(options), steps_(job.footage) {}

  void WriteAll(BuiltCamera* built) {
    bool ended = false;
    for (int64_t number = 0; !ended; ++number) {
      const std::string kept = BuiltBlockFolder(job_, number);
      std::optional<BuiltBlock> block = ReadBuiltBlock(kept);
      if (block) {
        TakeBuiltBlock(kept, job_.folder);
        for (int i = 0; i < block->built.images; ++i) job_.on_image();
      } else {
        block = kept.empty() || fs::exists(kept) ? Write(number, job_.folder) : WriteKept(number, kept);
      }
      AddBlock(block->built, built);
      ended = block->ended;
    }
    if (built->images > 0) built->mean_area_fraction /= built->images;
  }

 private:
  BuiltBlock WriteKept(int64_t number, const std::string& kept) {
    const UntracedScope untraced;
    const OutputLockScope locks;  // that of each block ends with it
    AtomicFolder folder(kept, false);
    const BuiltBlock block = Write(number, folder.work_path());
    WriteBuiltBlock(block, folder.work_path());
    folder.Commit();
    TakeBuiltBlock(kept, job_.folder);
    return block;
  }

  BuiltBlock Write(int64_t number, const std::string& folder) {
    if (!source_) source_ = OpenFrames(job_.footage.path, {options_.keep_undamaged});
    BuiltBlock block;
    while (position_ < (number + 1) * kBuildBlock) {
      const auto frame = source_->Advance();
      block.ended = !frame;
      if (!frame) break;
      if (position_++ >= number * kBuildBlock) WriteFrame(frame->number, folder, &block.built);
    }
    return block;
  }

  void WriteFrame(int64_t number, const std::string& folder, BuiltCamera* built) {
    Image rgb;
    for (const int step : steps_.Of(number)) {
      const auto people = job_.poses->find(step);
      if (people == job_.poses->end()) continue;
      if (rgb.empty()) rgb = source_->FullImage();
      const std::string name = FrameName(job_.name, step);
      WriteImage(rgb, folder + "/hdImgs/" + job_.name + "/" + name + (options_.png ? ".png" : ".jpg"), options_.jpeg_quality);
      WriteMask(rgb, number, step, people->second, folder + "/masks/" + job_.name + "/" + name + ".png", built);
      ++built->images;
      job_.on_image();
    }
  }

  void WriteMask(const Image& rgb, int64_t number, int step, const People& people, const std::string& path,
                 BuiltCamera* built) const {
    if (job_.masks) {
      const Image mask = GivenMask(*job_.masks, number, rgb.width, rgb.height);
      if (mask.empty()) return built->without_mask.push_back(step);
      WriteImage(mask, path);
      built->mean_area_fraction += AreaFraction(mask);
    } else if (model_) {
      const BodyMask mask = SegmentBody(rgb, ProjectBody(people, camera_, options_.mask), *model_, options_.mask);
      WriteImage(mask.mask, path);
      AddToReport(mask, built);
    }
  }

  const CameraJob& job_;
  const geometry::RigCamera& camera_;
  const CameraMaskModel* model_;
  const BuildOptions& options_;
  const TimeSteps steps_;
  std::unique_ptr<FrameSource> source_;
  int64_t position_ = 0;  ///< of the next frame
};

double FrameRate(const CameraFootage& footage) {
  const std::string& path = footage.path;
  if (footage.timeline) return footage.timeline->fps_hz;
  if (!fs::is_regular_file(path) && !IsPattern(path)) return 0;
  const FootageFiles files = ListFootage(path);
  return files.is_video ? VideoReader(files.paths[0]).info().frame_rate_hz : 0;
}

CameraMaskModel Learn(const CameraJob& job, const Samples& samples, const geometry::RigCamera& camera,
                      const MaskOptions& options) {
  Image plate;
  if (!job.footage.plate.empty()) {
    plate = ReadImage(job.footage.plate);
    if (plate.width != samples.width || plate.height != samples.height) {
      throw FormatError(job.footage.plate, "",
                        "the clean plate is " + SizeText(plate.width, plate.height) + ", the footage " +
                            SizeText(samples.width, samples.height));
    }
  }
  std::vector<ProjectedBody> bodies;
  for (const People& people : samples.people) bodies.push_back(ProjectBody(people, camera, options));
  return LearnCamera(samples.frames, bodies, plate.empty() ? nullptr : &plate, options);
}

CameraResult Build(const CameraJob& job, const BuildOptions& options) {
  CameraResult result;
  result.frame_rate_hz = FrameRate(job.footage);
  Samples samples = ReadSamples(job, SampleFrames(*job.poses, options.mask.background_frames), options);
  result.gaps = samples.gaps;
  result.size = MatchSize(job, samples, options, &result.warnings);
  result.camera = ApplySizeRule(job.camera, result.size.rule, samples.width, samples.height);
  result.built.name = job.name;
  result.built.alias = job.footage.camera;
  result.built.size_rule = result.size.rule.name;
  CameraMaskModel model;
  const bool masks = options.masks && !job.masks && !samples.frames.empty();
  if (masks) {
    model = Learn(job, samples, result.camera, options.mask);
    result.built.background_known = model.background.KnownFraction();
  }
  samples.frames.clear();
  FrameWriter(job, result.camera, masks ? &model : nullptr, options).WriteAll(&result.built);
  result.camera.camera.name = job.name;
  return result;
}

}  // namespace

void RequireSizes(const std::vector<CameraJob>& jobs, const std::string& calibration, const BuildOptions& options) {
  std::string wrong, sizes;
  for (const CameraJob& job : jobs) {
    const geometry::Camera& c = job.camera.camera;
    const auto source = OpenFrames(job.footage.path, {options.keep_undamaged});
    if (!source->Advance()) continue;
    const auto [width, height] = source->size_px();
    if (!SizeRules(c.width_px, c.height_px, width, height).empty()) continue;
    const bool rotated = width == c.height_px && height == c.width_px;
    wrong += (wrong.empty() ? "" : "; ") + ("camera " + job.footage.camera) + ": footage is " + SizeText(width, height) +
             ", the calibration is for " + SizeText(c.width_px, c.height_px) +
             (rotated ? ": the footage is turned by a quarter" : ": more than 2 % apart");
    if (!rotated) sizes += " option 'camera-size' " + ShellWord(job.footage.camera + "=" + SizeText(width, height));
  }
  if (wrong.empty()) return;
  const std::string resize = sizes.empty() ? ""
                                           : ", or, for the same part of the sensor, mvstudio calib resize " +
                                                 ShellWord(calibration) + sizes + " option 'out' resized.json";
  throw FormatError(calibration, "", wrong + "; calibrate at this size or give the footage that was calibrated" + resize);
}

CameraResult BuildCamera(const CameraJob& job, const BuildOptions& options) {
  try {
    return Build(job, options);
  } catch (const FormatError& error) {
    const std::string prefix = error.path() + (error.where().empty() ? "" : ": " + error.where()) + ": ";
    const std::string what = std::string(error.what()).substr(std::min(prefix.size(), std::string(error.what()).size()));
    throw FormatError(error.path(), "camera " + job.footage.camera + (error.where().empty() ? "" : ", " + error.where()), what);
  }
}

}  // namespace mvstudio::dataset::internal
