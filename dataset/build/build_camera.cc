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
#include "dataset/build/first_pass.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

using Samples = FootageSamples;

std::vector<People> PeopleOf(const CameraJob& job, const Samples& samples) {
  std::vector<People> people;
  for (const int time_step : samples.time_steps) people.push_back(job.poses->at(time_step));
  return people;
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
  const std::string sizes = "footage is " + PixelsText(samples.width, samples.height) + ", the calibration is for " +
                            PixelsText(c.width_px, c.height_px);
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
    decision = DecideSizeRule(rules, job.camera, samples.frames, PeopleOf(job, samples), job.joint_rms_px, options.mask);
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

  /// Folders of the blocks from `first` to before `end` that are there then; a damaged one is left to the build.
  std::vector<std::string> KeepAll(int64_t first, int64_t end) {
    std::vector<std::string> folders;
    for (int64_t number = first; number < end; ++number) {
      const std::string kept = BuiltBlockFolder(job_, number);
      std::optional<BuiltBlock> block = ReadBuiltBlock(kept);
      if (!block && !fs::exists(kept)) block = MakeKept(number, kept);
      if (!block) continue;
      folders.push_back(kept);
      if (block->ended) break;
    }
    return folders;
  }

 private:
  BuiltBlock WriteKept(int64_t number, const std::string& kept) {
    const BuiltBlock block = MakeKept(number, kept);
    TakeBuiltBlock(kept, job_.folder);
    return block;
  }

  BuiltBlock MakeKept(int64_t number, const std::string& kept) {
    const UntracedScope untraced;
    const OutputLockScope locks;  // that of each block ends with it
    AtomicFolder folder(kept, false);
    const BuiltBlock block = Write(number, folder.work_path());
    WriteBuiltBlock(block, folder.work_path());
    folder.Commit();
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
      const Image mask = MaskOfFrame(*job_.masks, number, rgb.width, rgb.height);
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
                        "the clean plate is " + PixelsText(plate.width, plate.height) + ", the footage " +
                            PixelsText(samples.width, samples.height));
    }
  }
  std::vector<ProjectedBody> bodies;
  for (const People& people : PeopleOf(job, samples)) bodies.push_back(ProjectBody(people, camera, options));
  return LearnCamera(samples.frames, bodies, plate.empty() ? nullptr : &plate, options);
}

bool NeedsFrames(const CameraJob& job, const Samples& samples, const BuildOptions& options) {
  const geometry::Camera& c = job.camera.camera;
  return (options.masks && !job.masks) || SizeRules(c.width_px, c.height_px, samples.width, samples.height).size() > 1;
}

/// Kept by an earlier pass, or read. `keep_frames`: also where that takes room.
Samples SamplesOf(const CameraJob& job, const BuildOptions& options, bool keep_frames) {
  if (std::optional<Samples> kept = ReadKeptSamples(job)) return std::move(*kept);
  Samples samples = ReadSamples(job, SampleFrames(*job.poses, options.mask.background_frames), options);
  const bool needed = NeedsFrames(job, samples, options);
  if (!needed) samples.frames.clear(), samples.time_steps.clear();
  if (!needed || keep_frames) KeepSamples(samples, job);
  return samples;
}

/// What all blocks of a camera stand on.
struct CameraStart {
  CameraResult result;
  std::optional<CameraMaskModel> model;
};

CameraStart StartOf(const CameraJob& job, const Samples& samples, const BuildOptions& options) {
  CameraStart start;
  CameraResult& result = start.result;
  result.frame_rate_hz = FrameRate(job.footage);
  result.gaps = samples.gaps;
  result.size = MatchSize(job, samples, options, &result.warnings);
  result.camera = ApplySizeRule(job.camera, result.size.rule, samples.width, samples.height);
  result.built.name = job.name;
  result.built.alias = job.footage.camera;
  result.built.size_rule = result.size.rule.name;
  if (!options.masks || job.masks || samples.frames.empty()) return start;
  start.model = Learn(job, samples, result.camera, options.mask);
  result.built.background_known = start.model->background.KnownFraction();
  return start;
}

CameraResult Build(const CameraJob& job, const BuildOptions& options) {
  CameraStart start = StartOf(job, SamplesOf(job, options, false), options);
  CameraResult& result = start.result;
  FrameWriter(job, result.camera, start.model ? &*start.model : nullptr, options).WriteAll(&result.built);
  result.camera.camera.name = job.name;
  return std::move(result);
}

std::vector<std::string> KeepPart(const CameraJob& job, const BuildPart& part, const BuildOptions& options) {
  const Samples samples = SamplesOf(job, options, true);
  if (part.samples) return {job.kept + "/samples/" + job.name};
  const CameraStart start = StartOf(job, samples, options);
  return FrameWriter(job, start.result.camera, start.model ? &*start.model : nullptr, options)
      .KeepAll(part.first_block, part.end_block);
}

/// FormatErrors name the camera.
template <class Work>
auto NamingCamera(const CameraJob& job, const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const FormatError& error) {
    const std::string prefix = error.path() + (error.where().empty() ? "" : ": " + error.where()) + ": ";
    const std::string what = std::string(error.what()).substr(std::min(prefix.size(), std::string(error.what()).size()));
    throw FormatError(error.path(), "camera " + job.footage.camera + (error.where().empty() ? "" : ", " + error.where()), what);
  }
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
    wrong += (wrong.empty() ? "" : "; ") + ("camera " + job.footage.camera) + ": footage is " + PixelsText(width, height) +
             ", the calibration is for " + PixelsText(c.width_px, c.height_px) +
             (rotated ? ": the footage is turned by a quarter" : ": more than 2 % apart");
    if (!rotated) sizes += " option 'camera-size' " + ShellWord(job.footage.camera + "=" + PixelsText(width, height));
  }
  if (wrong.empty()) return;
  const std::string resize = sizes.empty() ? ""
                                           : ", or, for the same part of the sensor, mvstudio calib resize " +
                                                 ShellWord(calibration) + sizes + " option 'out' resized.json";
  throw FormatError(calibration, "", wrong + "; calibrate at this size or give the footage that was calibrated" + resize);
}

std::vector<std::string> KeepCameraPart(const CameraJob& job, const BuildPart& part, const BuildOptions& options) {
  return NamingCamera(job, [&] { return KeepPart(job, part, options); });
}

CameraResult BuildCamera(const CameraJob& job, const BuildOptions& options) {
  return NamingCamera(job, [&] { return Build(job, options); });
}

}  // namespace mvstudio::dataset::internal
