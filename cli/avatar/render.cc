#include "avatar/run/render/render.h"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>

#include "avatar/run/gaussians/gaussian_render.h"
#include "avatar/run/render/backdrop.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/dataset/studio_names.h"
#include "stages/frame_notice.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

namespace fs = std::filesystem;
using avatar::RenderJob;
using avatar::RenderPlan;
using Clock = std::chrono::steady_clock;

struct RenderArguments {
  std::string run_folder, out, video, background, frames;
  double rate_hz = 0;
  bool overwrite = false;
  avatar::RenderOptions options;
};

/// What a run is rendered from.
std::string ModelPath(const std::string& run_folder) {
  return run_folder + "/" + (avatar::HoldsGaussians(run_folder) ? avatar::kGaussiansFile : avatar::kCheckpointFile);
}

/// The network of a run, or its Gaussians.
struct Loaded {
  std::optional<avatar::AvatarModel> network;
  std::optional<splats::CloudFile> gaussians;
  avatar::Method method = avatar::Method::kGaussians;
  int size_px = 0;
  int64_t step = 0;
};

Loaded Load(const std::string& run_folder, const avatar::RunConfig& config) {
  Loaded loaded;
  loaded.size_px = config.pack.size_px;
  if (avatar::HoldsGaussians(run_folder)) {
    const auto faces = static_cast<int>(config.pack.fitted->person.body.faces.cols());
    loaded.gaussians = splats::ReadCloud(ModelPath(run_folder), faces);
    loaded.step = loaded.gaussians->step;
    return loaded;
  }
  loaded.network = avatar::LoadModel(ModelPath(run_folder));
  loaded.method = loaded.network->options.method;
  loaded.size_px = loaded.network->size_px, loaded.step = loaded.network->step;
  return loaded;
}

/// Pictures as files of a folder, as one video a view, or both.
class PictureSink {
 public:
  PictureSink(const RenderArguments& arguments, const RenderPlan& plan)
      : video_(arguments.video), backdrop_(BackdropText(arguments)), rate_hz_(RateOf(arguments, plan)) {
    for (const RenderJob& job : plan.jobs) views_.insert(job.view);
    if (!video_.empty() && fs::path(video_).extension() != ".mp4")
      throw UsageError("--video " + video_ + ": videos are written as .mp4");
    for (const std::string& view : views_) {
      if (!video_.empty() && !arguments.overwrite && fs::exists(VideoPath(view)))
        throw UsageError("--video " + VideoPath(view) + " is there: choose another name or give --overwrite");
    }
    if (!video_.empty()) LockVideos();
    folder_path_ = !arguments.out.empty() ? arguments.out : video_.empty() ? arguments.run_folder + "/render" : "";
    const bool own_folder = arguments.out.empty();
    if (!folder_path_.empty() && !video_.empty() && PathOnDisk(video_).rfind(PathOnDisk(folder_path_ + "/") + "/", 0) == 0)
      throw UsageError("--video " + video_ + ": lies in --out, which is made anew as a whole; choose another name");
    if (!folder_path_.empty())
      // Files of the run, not its folder: RUN/render is a usual place, RUN itself is none.
      folder_ = std::make_unique<AtomicFolder>(folder_path_, arguments.overwrite || own_folder,
                                               std::vector<std::string>{ModelPath(arguments.run_folder)});
  }

  void Add(const RenderJob& job, const Image& premultiplied) {
    const Image picture = backdrop_.Under(premultiplied);
    if (folder_) {
      const std::string name = job.view + "/" + job.view + Format("_%08d.png", job.frame);
      MakeFolder(folder_->work_path() + "/" + job.view);
      dataset::WriteImage(picture, folder_->work_path() + "/" + name);
      outputs_.push_back({folder_path_ + "/" + name, "rendered-picture"});
    }
    if (!video_.empty()) AddToVideo(job.view, picture);
  }

  std::vector<CommandResult::Output> Finish() {
    CloseVideo();
    videos_->Commit();
    videos_.reset();  // what is written from now on is no video
    if (folder_) folder_->Commit();
    return outputs_;
  }
  double rate_hz() const { return rate_hz_; }

 private:
  /// A video has no opacity: black unless a backdrop is asked for.
  static std::string BackdropText(const RenderArguments& arguments) {
    const bool none = arguments.background.empty() || arguments.background == "none";
    return none && !arguments.video.empty() ? "black" : arguments.background;
  }
  static double RateOf(const RenderArguments& arguments, const RenderPlan& plan) {
    constexpr double kUsualHz = 30;
    if (arguments.rate_hz < 0 || arguments.rate_hz > 1000) throw UsageError("--fps must be in 0..1000");
    return arguments.rate_hz > 0 ? arguments.rate_hz : plan.rate_hz > 0 ? plan.rate_hz : kUsualHz;
  }
  void LockVideos() {
    std::vector<std::string> paths;
    for (const std::string& view : views_) paths.push_back(VideoPath(view));
    place_ = std::make_unique<OutputFiles>(paths, std::vector<std::string>());
  }
  std::string VideoPath(const std::string& view) const {
    if (views_.size() < 2) return video_;
    const fs::path path(video_);
    return (path.parent_path() / (path.stem().string() + "_" + view + path.extension().string())).string();
  }
  void AddToVideo(const std::string& view, const Image& picture) {
    if (view != open_view_) {
      CloseVideo();
      open_view_ = view;
      if (fs::path(video_).has_parent_path()) MakeFolder(fs::path(video_).parent_path().string());
      const bool odd = picture.width % 2 != 0 || picture.height % 2 != 0;
      writer_ = std::make_unique<dataset::VideoWriter>(VideoPath(view), picture.width, picture.height, rate_hz_, 16, odd);
    }
    writer_->Write(picture);
  }
  void CloseVideo() {
    if (!writer_) return;
    writer_->Close();
    writer_.reset();
    outputs_.push_back({VideoPath(open_view_), "video"});
  }

  std::string video_, folder_path_, open_view_;
  avatar::Backdrop backdrop_;
  double rate_hz_;
  std::set<std::string> views_;
  std::unique_ptr<OutputFiles> place_;
  std::unique_ptr<AtomicFolder> folder_;
  std::optional<FilesTogether> videos_{std::in_place};
  std::unique_ptr<dataset::VideoWriter> writer_;
  std::vector<CommandResult::Output> outputs_;
};

void FillMetrics(const RenderArguments& a, const RenderPlan& plan, const Loaded& model, double seconds, double rate_hz,
                 CommandResult* result) {
  std::set<std::string> views;
  for (const RenderJob& job : plan.jobs) views.insert(job.view);
  auto& m = result->metrics;
  m["pictures"] = plan.jobs.size();
  m["views"] = views;
  m["poses"] = {{"source", plan.track.source}, {"number", plan.track.poses.size()}};
  m["scale"] = {{"normalised", plan.scaled}, {"trained_over_given", plan.ratio}};
  m["size_px"] = a.options.size_px > 0 ? a.options.size_px : model.size_px;
  if (model.method != avatar::Method::kGaussians)
    m["network_size_px"] = a.options.network_size_px > 0 ? a.options.network_size_px : model.size_px;
  m["frame"] = ToString(a.options.frame);
  m["rate_hz"] = rate_hz;
  m["method"] = ToString(model.method);
  m["checkpoint_step"] = model.step;
  m["seconds_per_picture"] = FiniteOrNull(seconds / static_cast<double>(plan.jobs.size()));
}

void AddWarnings(const RenderArguments& a, const RenderPlan& plan, const Loaded& model, CommandResult* result) {
  if (!a.options.calib.empty()) stages::AddImplausible(dataset::ReadAnyCalibration(a.options.calib), result);
  if (!plan.skipped.empty()) {
    result->exit = kExitPartial;
    result->warnings.push_back(
        {"AVA-SKIPPED", std::to_string(plan.skipped.size()) + " images could not be made; the first: " + plan.skipped.front(),
         "leave these cameras or frames out, or use --place training"});
  }
  stages::TellFrames(plan.track.beyond, result);
  constexpr double kSameSize = 0.05;
  if (plan.foreign && !plan.scaled && std::abs(plan.ratio - 1) > kSameSize) {
    const std::string text =
        Format("the poses' bones are %.3g times the trained person's, which the network never saw", 1 / plan.ratio);
    result->warnings.push_back({"AVA-SCALE", text, "render with --scale-normalise on"});
  }
  if (model.method == avatar::Method::kV2v && a.options.turntable > 0) {
    result->warnings.push_back({"AVA-V2V-MOVING-CAMERA",
                                "v2v uses the previous image and was trained with cameras that do not move",
                                "expect trails, or turn with an avatar of method tna"});
  }
}

CommandResult RunAvatarRender(const RenderArguments& arguments, CommandContext& context) {
  avatar::RenderOptions options = arguments.options;
  if (!arguments.frames.empty()) options.frames = ParseRanges("--frames", arguments.frames);
  const avatar::RunConfig config = avatar::OpenRun(arguments.run_folder, options.dataset);
  if (options.calib.empty()) context.camera_names = stages::StudioNames(config.dataset);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(config.dataset);
  RenderPlan plan = avatar::MakeRenderPlan(config, data, options);
  Loaded model = Load(arguments.run_folder, config);
  if (model.network) plan.references = ReadReferences(arguments.run_folder, config, model.network->options);
  PictureSink sink(arguments, plan);
  const Clock::time_point start = Clock::now();
  const auto add = [&](const RenderJob& job, const Image& picture) { sink.Add(job, picture); };
  if (model.gaussians) {
    RenderGaussianPictures(*model.gaussians, config, plan, options, context.run, add);
  } else {
    RenderPictures(*model.network, config, plan, options, context.run, add);
  }
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  CommandResult result;
  result.outputs = sink.Finish();
  result.folder = arguments.run_folder;
  result.inputs = {arguments.run_folder, config.dataset};
  for (const std::string& input : {options.calib, options.poses, options.bvh}) {
    if (!input.empty()) result.inputs.push_back(input);
  }
  FillMetrics(arguments, plan, model, seconds, sink.rate_hz(), &result);
  AddWarnings(arguments, plan, model, &result);
  std::ostringstream text;
  text << plan.jobs.size() << " images of " << result.metrics["views"].size() << " view(s), " << plan.track.poses.size()
       << " pose(s) of " << plan.track.source;
  if (plan.scaled) text << " in the trained person's size (x " << plan.ratio << ")";
  text << ", " << seconds / static_cast<double>(plan.jobs.size()) << " s each\n";
  if (!result.outputs.empty()) text << "  " << result.outputs.front().path << (result.outputs.size() > 1 ? " …\n" : "\n");
  result.text = text.str();
  return result;
}

}  // namespace

void RegisterAvatarRender(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<RenderArguments>();
  CLI::App* sub = avatar.add_subcommand(
      "render", "New images of a trained avatar: any calibrated camera, other poses, or an orbiting camera");
  AddOption(sub, "run", a->run_folder, "folder of the training run (--out of `avatar train`)")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder,
            "folder of the images; RUN/render unless given or only --video is asked for");
  AddOutput(sub, "--video", a->video, OutputKind::kFile, "video file, .mp4; with several cameras one each, NAME_CAMERA.mp4");
  AddOption(sub, "--background", a->background,
            "colour (black, white, grey, green, #rrggbb or r,g,b) or image behind the person; none: PNG with opacity (videos: "
            "black)");
  AddOption(sub, "--frames", a->frames, "frames to render, e.g. 90-119; those held out unless given (other takes: all)");
  AddOption(sub, "--fps", a->rate_hz, "Hz; frame rate of the video; 0: that of the poses")->capture_default_str();
  AddFlag(sub, "--overwrite", a->overwrite, "replace what is at --out or --video");
  AddOptions(sub, a->options);
  registry.Add(sub, "avatar render", [a](CommandContext& context) { return RunAvatarRender(*a, context); });
}

}  // namespace mvstudio::cli
