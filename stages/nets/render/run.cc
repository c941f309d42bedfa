#include "stages/nets/render/run.h"

#include <filesystem>
#include <optional>
#include <set>

#include "avatar/run/gaussians/gaussian_render.h"
#include "avatar/run/render/backdrop.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/stopwatch.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/input/calib_read.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using avatar::RenderJob;
using avatar::RenderPlan;

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

/// Images as files of a folder, as one video a view, or both.
class ImageSink {
 public:
  ImageSink(const AvatarRenderOptions& options, const RenderPlan& plan)
      : video_(options.video), backdrop_(BackdropText(options)), rate_hz_(RateOf(options, plan)) {
    for (const RenderJob& job : plan.jobs) views_.insert(job.view);
    if (!video_.empty() && fs::path(video_).extension() != ".mp4")
      throw UsageError("option 'video' " + video_ + ": videos are written as .mp4");
    for (const std::string& view : views_) {
      if (!video_.empty() && !options.overwrite && fs::exists(VideoPath(view)))
        throw ResultExistsError(
            VideoPath(view), "option 'video' " + VideoPath(view) + " is there: choose another name or give option 'overwrite'");
    }
    if (!video_.empty()) LockVideos();
    folder_path_ = !options.out.empty() ? options.out : video_.empty() ? options.run_folder + "/render" : "";
    const bool own_folder = options.out.empty();
    if (!folder_path_.empty() && !video_.empty() && PathOnDisk(video_).rfind(PathOnDisk(folder_path_ + "/") + "/", 0) == 0)
      throw UsageError("option 'video' " + video_ +
                       ": lies in option 'out', which is made anew as a whole; choose another name");
    if (!folder_path_.empty())
      // Files of the run, not its folder: RUN/render is a usual place, RUN itself is none.
      folder_ = std::make_unique<AtomicFolder>(folder_path_, options.overwrite || own_folder,
                                               std::vector<std::string>{ModelPath(options.run_folder)});
  }

  void Add(const RenderJob& job, const Image& premultiplied) {
    const Image image = backdrop_.Under(premultiplied);
    if (folder_) {
      const std::string name = job.view + "/" + job.view + Format("_%08d.png", job.frame);
      MakeFolder(folder_->work_path() + "/" + job.view);
      dataset::WriteImage(image, folder_->work_path() + "/" + name);
      outputs_.push_back({folder_path_ + "/" + name, "rendered-picture"});
    }
    if (!video_.empty()) AddToVideo(job.view, image);
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
  static std::string BackdropText(const AvatarRenderOptions& options) {
    const bool none = options.background.empty() || options.background == "none";
    return none && !options.video.empty() ? "black" : options.background;
  }
  static double RateOf(const AvatarRenderOptions& options, const RenderPlan& plan) {
    constexpr double kUsualHz = 30;
    if (options.rate_hz < 0 || options.rate_hz > 1000) throw UsageError("option 'fps' must be in 0..1000");
    return options.rate_hz > 0 ? options.rate_hz : plan.rate_hz > 0 ? plan.rate_hz : kUsualHz;
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
  void AddToVideo(const std::string& view, const Image& image) {
    if (view != open_view_) {
      CloseVideo();
      open_view_ = view;
      if (fs::path(video_).has_parent_path()) MakeFolder(fs::path(video_).parent_path().string());
      const bool odd = image.width % 2 != 0 || image.height % 2 != 0;
      writer_ = std::make_unique<dataset::VideoWriter>(VideoPath(view), image.width, image.height, rate_hz_, 16, odd);
    }
    writer_->Write(image);
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

}  // namespace

AvatarRenderReport RunAvatarRender(const AvatarRenderOptions& options, const RunContext& run) {
  avatar::RenderOptions render = options.render;
  if (!options.frames.empty()) render.frames = ParseRanges("option 'frames'", options.frames);
  const avatar::RunConfig config = avatar::OpenRun(options.run_folder, render.dataset);
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(config.dataset);
  AvatarRenderReport report;
  report.options = options, report.dataset = config.dataset;
  RenderPlan& plan = report.plan = avatar::MakeRenderPlan(config, data, render);
  Loaded model = Load(options.run_folder, config);
  report.method = model.method, report.trained_size_px = model.size_px, report.checkpoint_step = model.step;
  if (model.network) plan.references = ReadReferences(options.run_folder, config, model.network->options);
  ImageSink sink(options, plan);
  const Stopwatch watch;
  const auto add = [&](const RenderJob& job, const Image& image) { sink.Add(job, image); };
  if (model.gaussians) {
    RenderGaussianImages(*model.gaussians, config, plan, render, run, add);
  } else {
    RenderImages(*model.network, config, plan, render, run, add);
  }
  report.seconds = watch.Seconds();
  report.outputs = sink.Finish();
  report.rate_hz = sink.rate_hz();
  if (!render.calib.empty()) AddImplausible(dataset::ReadAnyCalibration(render.calib), &report.notes);
  return report;
}

}  // namespace mvstudio::stages
