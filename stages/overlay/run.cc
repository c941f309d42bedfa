#include "stages/overlay/run.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/session/session.h"
#include "stages/overlay/draw_view.h"
#include "stages/view/avatar_view.h"
#include "stages/view/frame_store.h"
#include "stages/view/mask_files.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

constexpr double kUsualRateHz = 30;

std::vector<int> ChosenSteps(const Scene& scene, const std::string& frames) {
  if (frames.empty()) return scene.steps;
  std::vector<int> chosen;
  const auto wanted = ParseRanges("option 'frames'", frames);
  const std::set<int> asked(wanted.begin(), wanted.end());
  for (const int step : scene.steps) {
    if (asked.count(step) > 0) chosen.push_back(step);
  }
  return chosen;
}

double RateOf(const Scene& scene, double asked_hz) {
  if (!(asked_hz >= 0 && asked_hz <= 1000)) throw UsageError("option 'fps' must be in 0..1000");
  if (asked_hz > 0) return asked_hz;
  if (scene.fps_hz > 0) return scene.fps_hz;
  for (const SceneCamera& camera : scene.cameras) {
    if (camera.footage.empty()) continue;
    const double stated_hz = dataset::DescribeFootage(camera.footage).fps_hz;
    if (stated_hz > 0) return stated_hz;
  }
  return kUsualRateHz;
}

/// Videos in a folder, one of each name, begun with their first image.
class OverlayVideos {
 public:
  OverlayVideos(std::string folder, double rate_hz) : folder_(std::move(folder)), rate_hz_(rate_hz) {}

  void Add(const std::string& name, const Image& image) {
    auto& writer = writers_[name];
    if (!writer) writer = std::make_unique<dataset::VideoWriter>(folder_ + "/" + name, image.width, image.height, rate_hz_, 20);
    writer->Write(image);
  }
  std::vector<std::string> Close() {
    std::vector<std::string> names;
    for (auto& [name, writer] : writers_) writer->Close(), names.push_back(name);
    return names;
  }

 private:
  std::string folder_;
  double rate_hz_;
  std::map<std::string, std::unique_ptr<dataset::VideoWriter>> writers_;
};

class OverlayDrawer {
 public:
  OverlayDrawer(const Scene& scene, const OverlaySolids& solids, const OverlayOptions& options)
      : scene_(scene),
        solids_(solids),
        options_(options),
        store_(scene.root, 0),
        renders_(ReadRenders(scene, options.beside, "beside")) {
    for (const SceneCamera& camera : scene.cameras)
      masks_.emplace_back(options.marks.masks ? camera.mask_folder : "", scene.root);
  }
  std::vector<Image> At(int step) {
    std::vector<Image> tiles;
    const SolidsNow now = SolidsAt(solids_, step);
    for (size_t c = 0; c < scene_.cameras.size(); ++c) {
      const SceneView view = ViewAt(scene_, c, step);
      const Image frame = store_.Read(scene_.cameras[c].footage, view.frame);
      num_missing_ += frame.empty() && !scene_.cameras[c].footage.empty();
      tiles.push_back(DrawnView(scene_, c, view, frame, masks_[c].At(view.frame), options_.tile_px, options_.marks, now));
      if (renders_[c].empty()) continue;
      const auto render = renders_[c].find(step);
      tiles[c] = WithRender(tiles[c], render == renders_[c].end() ? Image() : dataset::ReadImage(render->second));
    }
    return tiles;
  }
  size_t num_missing() const { return num_missing_; }

 private:
  const Scene& scene_;
  const OverlaySolids& solids_;
  const OverlayOptions& options_;
  FrameStore store_;
  std::vector<MaskFiles> masks_;
  std::vector<FilesByNumber> renders_;
  size_t num_missing_ = 0;
};

/// Evenly over the take, the middle of each part.
std::set<size_t> SheetPlaces(size_t num_steps, int num_sheet) {
  std::set<size_t> places;
  const auto parts = std::min(num_steps, static_cast<size_t>(num_sheet));
  for (size_t i = 0; i < parts; ++i) places.insert((2 * i + 1) * num_steps / (2 * parts));
  return places;
}

}  // namespace

OverlayReport RunOverlay(const OverlayOptions& options, const RunContext& run) {
  if (options.tile_px != 0 && options.tile_px < 16) throw UsageError("option 'tile-px' must be 0 or at least 16");
  if (options.num_sheet < 0) throw UsageError("option 'sheet' must not be negative");
  OverlayReport report;
  report.options = options;
  const Scene scene = ReadScene(options.scene, &report.notes);
  const std::vector<int> steps = ChosenSteps(scene, options.frames);
  if (scene.cameras.empty() || steps.empty())
    throw UsageError(options.scene.path + ": has neither footage nor joints at these time steps; nothing is drawn");
  report.rate_hz = RateOf(scene, options.rate_hz);
  const OverlaySolids solids = ReadSolids(options.scene, {options.marks.boards, options.marks.body}, scene, &report.notes);
  if (!options.beside.empty()) report.notes.inputs.push_back(options.beside);
  AtomicFolder folder(options.out, options.overwrite, report.notes.inputs);
  OverlayVideos videos(folder.work_path(), report.rate_hz);
  OverlayDrawer drawer(scene, solids, options);
  const std::set<size_t> places = SheetPlaces(steps.size(), options.num_sheet);
  std::vector<Image> sheet;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (run.progress && run.progress->Cancelled()) throw CancelledError("interrupted; nothing was written");
    const std::vector<Image> tiles = drawer.At(steps[i]);
    const Image grid = GridOf(tiles);
    for (size_t c = 0; options.each && c < tiles.size(); ++c)
      videos.Add(dataset::Slug(scene.cameras[c].name) + ".mp4", GridOf({tiles[c]}));
    if (!options.each) videos.Add("overlay.mp4", grid);
    if (places.count(i) > 0) sheet.push_back(dataset::Reduced(grid, 960));
  }
  for (const std::string& name : videos.Close()) report.outputs.emplace_back(options.out + "/" + name, "video");
  if (!sheet.empty()) {
    dataset::WriteImage(GridOf(sheet), folder.work_path() + "/sheet.png");
    report.outputs.emplace_back(options.out + "/sheet.png", "contact-sheet");
  }
  folder.Commit();
  report.num_cameras = scene.cameras.size(), report.num_steps = steps.size(), report.num_missing = drawer.num_missing();
  return report;
}

}  // namespace mvstudio::stages
