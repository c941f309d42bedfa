#include "stages/calib/board_views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "calib/detect/detect_board.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "stages/input/frame_images.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

constexpr int kLongerSidePx = 480;
constexpr size_t kMostBytes = size_t{64} << 10, kMostBytesTogether = size_t{1} << 20;

int NumKept(const BoardView& view) {
  return static_cast<int>(std::count_if(view.corners.begin(), view.corners.end(), [](const auto& c) { return !c.rejected; }));
}

double RmsPx(const BoardView& view) {
  std::vector<double> lengths;
  for (const calib::CornerResidual& c : view.corners) {
    if (!c.rejected) lengths.push_back(c.residual_px.norm());
  }
  return Rms(lengths);
}

/// Indices of the views with at least this share of the most corners of any.
std::vector<size_t> WithCorners(const std::vector<BoardView>& views, double share) {
  int most = 0;
  for (const BoardView& view : views) most = std::max(most, NumKept(view));
  std::vector<size_t> rich;
  for (size_t i = 0; i < views.size(); ++i) {
    if (NumKept(views[i]) > 0 && NumKept(views[i]) >= share * most) rich.push_back(i);
  }
  return rich;
}

/// The ordinary view and the worst of one camera.
std::vector<BoardView> ChooseOf(const std::vector<BoardView>& views) {
  std::vector<size_t> ordinary = WithCorners(views, 0.75), any = WithCorners(views, 0.5);
  if (ordinary.empty()) return {};
  const auto by_rms = [&](size_t a, size_t b) { return views[a].rms_px < views[b].rms_px; };
  const auto middle = ordinary.begin() + static_cast<std::ptrdiff_t>(ordinary.size() / 2);
  std::nth_element(ordinary.begin(), middle, ordinary.end(), by_rms);
  const size_t worst = *std::max_element(any.begin(), any.end(), by_rms);
  std::vector<BoardView> chosen = {views[*middle]};
  if (worst != *middle) chosen.push_back(views[worst]), chosen.back().worst = true;
  return chosen;
}

/// Numbers of a camera's frames in its footage by those of the report.
class FrameNumbers {
 public:
  FrameNumbers(const CornerArguments& arguments, const calib::CalibrateReport& report, const std::vector<int>& kept)
      : drops_(report.frame_drops),
        steps_(report.cameras.size()),
        last_(report.cameras.size(), std::numeric_limits<int64_t>::max()) {
    for (size_t c = 0; c < report.cameras.size(); ++c) {
      shift_.push_back(report.frame_shift.empty() ? 0 : report.frame_shift[c]);
      rates_.push_back(report.frame_rates.empty() ? calib::FrameRate() : report.frame_rates[c].Inverse());
      if (arguments.cameras.empty()) continue;
      last_[c] = LastCheapFrame(arguments.cameras[static_cast<size_t>(kept[c])].path);
      const auto* camera = arguments.timeline ? arguments.timeline->Find(report.cameras[c].name) : nullptr;
      if (!camera) continue;
      for (const auto& [frame, step] : dataset::TimeStepOfEachFrame(*camera)) steps_[c][step] = frame;
    }
  }

  /// Negative: none, or one that takes long to reach.
  int64_t Of(int camera, int64_t frame_idx) const {
    const auto c = static_cast<size_t>(camera);
    int64_t frame = rates_[c].At(calib::FrameBeforeDrops(drops_, camera, frame_idx - shift_[c])).value_or(-1);
    if (!steps_[c].empty()) {
      const auto found = steps_[c].find(frame);
      frame = found == steps_[c].end() ? -1 : found->second;
    }
    return frame <= last_[c] ? frame : -1;
  }

 private:
  std::vector<int64_t> shift_;
  std::vector<calib::FrameRate> rates_;
  std::vector<calib::FrameDrop> drops_;
  std::vector<std::map<int64_t, int64_t>> steps_;
  std::vector<int64_t> last_;
};

FrameImage BoxOf(const BoardView& view, const calib::CalibrateReport& report) {
  std::vector<Eigen::Vector2d> points;
  for (const calib::CornerResidual& corner : view.corners) points.push_back(corner.px);
  return BoxAround(points, report.rig.cameras[static_cast<size_t>(view.camera_idx)].camera);
}

/// Fills the small images of one camera's views; those that cannot be read, or have another size, stay empty.
void FillBoardImages(const std::vector<BoardView>& views, const calib::CalibrateReport& report, int camera,
                     const NamedPath& footage, bool mirrored, std::vector<std::string>* drawn) {
  const geometry::Camera& lens = report.rig.cameras[static_cast<size_t>(camera)].camera;
  std::set<int64_t> numbers;
  for (const BoardView& view : views) {
    if (view.camera_idx == camera) numbers.insert(view.frame);
  }
  const std::map<int64_t, Image> images = ReadFrames(footage.path, numbers);
  const size_t most = std::min(kMostBytes, kMostBytesTogether / std::max<size_t>(1, views.size()));
  for (size_t i = 0; i < views.size(); ++i) {
    const auto image = images.find(views[i].frame);
    if (views[i].camera_idx != camera || image == images.end()) continue;
    const Image& frame = image->second;
    if (frame.width != lens.width_px || frame.height != lens.height_px) continue;
    const Image upright = mirrored ? calib::FlippedLeftRight(frame) : frame;
    (*drawn)[i] = SmallImage(upright, BoxOf(views[i], report), kLongerSidePx, most).jpeg;
  }
}

std::vector<std::string> ReadBoardImages(const CornerArguments& arguments, const calib::CalibrateReport& report,
                                         const std::vector<BoardView>& views, const std::vector<int>& kept,
                                         const RunContext& run) {
  std::vector<std::string> images(views.size());
  if (arguments.cameras.empty()) return images;
  ParallelFor(static_cast<int64_t>(kept.size()), ResolveThreads(run.num_threads), [&](int64_t c) {
    const NamedPath& camera = arguments.cameras[static_cast<size_t>(kept[static_cast<size_t>(c)])];
    const auto& flipped = arguments.mirrored;
    const bool mirrored = std::find(flipped.begin(), flipped.end(), camera.name) != flipped.end();
    FillBoardImages(views, report, static_cast<int>(c), camera, mirrored, &images);
  });
  return images;
}

std::vector<std::string> NamesOf(const std::vector<BoardView>& views) {
  std::vector<std::string> names;
  for (const BoardView& view : views)
    names.push_back(Format("%02d_%08lld.jpg", view.camera_idx, static_cast<long long>(view.frame)));
  return names;
}

}  // namespace

std::vector<BoardView> ChooseBoardViews(const calib::CalibrateReport& report,
                                        const std::function<int64_t(int camera, int64_t frame_idx)>& number) {
  std::map<std::pair<int, int64_t>, BoardView> by_frame;
  for (const calib::CornerResidual& corner : report.residuals) {
    BoardView& view = by_frame[{corner.camera_idx, corner.frame_idx}];
    view.camera_idx = corner.camera_idx, view.frame_idx = corner.frame_idx;
    view.corners.push_back(corner);
  }
  std::vector<std::vector<BoardView>> by_camera(report.cameras.size());
  for (auto& [key, view] : by_frame) {
    view.frame = number(view.camera_idx, view.frame_idx);
    view.rms_px = RmsPx(view);
    if (view.frame >= 0) by_camera[static_cast<size_t>(view.camera_idx)].push_back(std::move(view));
  }
  std::vector<BoardView> chosen;
  for (const auto& views : by_camera) {
    for (BoardView& view : ChooseOf(views)) chosen.push_back(std::move(view));
  }
  return chosen;
}

ordered_json BoardViewsJson(const calib::CalibrateReport& report, const std::vector<BoardView>& views,
                            const std::vector<std::string>& images) {
  ordered_json json = ordered_json::array();
  for (size_t i = 0; i < views.size(); ++i) {
    const BoardView& view = views[i];
    const FrameImage box = BoxOf(view, report);
    ordered_json corners = ordered_json::array();
    const auto rounded = [](double value, double step) { return std::round(value / step) * step; };
    for (const calib::CornerResidual& c : view.corners) {
      corners.push_back({rounded(c.px.x(), 1e-2), rounded(c.px.y(), 1e-2), rounded(-c.residual_px.x(), 1e-4),
                         rounded(-c.residual_px.y(), 1e-4), c.rejected ? 1 : 0});
    }
    json.push_back({{"camera", report.cameras[static_cast<size_t>(view.camera_idx)].name},
                    {"frame", view.frame},
                    {"kind", view.worst ? "worst" : "ordinary"},
                    {"rms_px", FiniteOrNull(view.rms_px)},
                    {"box_px", {box.x, box.y, box.width, box.height}},
                    {"picture", images[i].empty() ? ordered_json() : ordered_json(images[i])},
                    {"corners", corners}});
  }
  return json;
}

WrittenBoardViews WriteBoardViews(const CornerArguments& arguments, const calib::CalibrateReport& report,
                                  const std::vector<int>& kept, const std::string& out, const RunContext& run) {
  const FrameNumbers numbers(arguments, report, kept);
  WrittenBoardViews written;
  written.views = ChooseBoardViews(report, [&](int camera, int64_t frame_idx) { return numbers.Of(camera, frame_idx); });
  written.paths = WriteImages(ReadBoardImages(arguments, report, written.views, kept, run), NamesOf(written.views),
                              out + "/" + kBoardViewsFolder);
  return written;
}

CommandResult DescribeBoardViews(const calib::CalibrateReport& report, const WrittenBoardViews& written) {
  CommandResult result;
  result.metrics["board_views"] = BoardViewsJson(report, written.views, written.paths);
  for (const std::string& path : written.paths) {
    if (!path.empty()) result.outputs.push_back({path, "board-view"});
  }
  return result;
}

}  // namespace mvstudio::stages
