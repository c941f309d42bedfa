#include "stages/view/run.h"

#include <charconv>
#include <filesystem>
#include <limits>
#include <optional>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/pose/markers.h"
#include "geometry/rig/rig_io.h"
#include "stages/view/avatar_view.h"
#include "stages/view/frame_store.h"
#include "stages/view/marks.h"
#include "stages/view/rerun_site.h"
#include "stages/view/scene_parts.h"
#include "stages/view/view_page.h"

namespace mvstudio::stages {
namespace {

constexpr int kThumbPx = 160;

// The report's own policy stands in its page, with the digests of its scripts.
constexpr char kReportPolicy[] = "base-uri 'none'; form-action 'none'; frame-ancestors 'self'";
constexpr char kShellPolicy[] =
    "default-src 'none'; img-src 'self'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr char kBadAddress[] = "not here\n";
PageAnswer NotHere() { return {404, "text/plain; charset=utf-8", kBadAddress}; }

/// "12/340.jpg" after `folder`: two whole numbers, or one where `is_pair` is false; nothing for anything else.
std::optional<std::pair<int64_t, int64_t>> NumbersOf(const std::string& path, const std::string& folder, const std::string& end,
                                                     bool is_pair) {
  if (path.size() < folder.size() + end.size() || path.compare(0, folder.size(), folder) != 0) return std::nullopt;
  if (path.compare(path.size() - end.size(), end.size(), end) != 0) return std::nullopt;
  const char *at = path.data() + folder.size(), *const last = path.data() + path.size() - end.size();
  std::pair<int64_t, int64_t> numbers{0, 0};
  const auto take = [&](int64_t* number) {
    const auto [rest, error] = std::from_chars(at, last, *number);
    const bool found = error == std::errc() && *number >= 0;
    at = rest;
    return found;
  };
  if (is_pair && (!take(&numbers.first) || at == last || *at++ != '/')) return std::nullopt;
  if (!take(&numbers.second) || at != last) return std::nullopt;
  return numbers;
}

class ViewSite {
 public:
  ViewSite(const ViewOptions& options, ViewReport* report, std::string page, OverlaySolids solids)
      : report_(*report),
        page_(std::move(page)),
        marks_(report->scene, std::move(solids)),
        avatar_(report->scene, marks_.solids(), options.avatar),
        store_(report->scene.root, static_cast<size_t>(options.cache_mb * 1e6)),
        life_(options.idle_min) {}

  PageAnswer operator()(const PageRequest& request) {
    life_.Ask(request.path);
    if (request.method != "GET") return {405, "text/plain; charset=utf-8", "GET only\n"};
    const std::string& path = request.path;
    const std::string html = "text/html; charset=utf-8";
    if (path.empty()) return {200, html, ViewPageHtml(), kShellPolicy};
    if (path == "report" && !page_.empty()) return {200, html, page_, kReportPolicy};
    if (path == "view.css") return {200, "text/css; charset=utf-8", ViewPageStyle()};
    if (path == "icon.svg") return {200, "image/svg+xml", ViewPageIcon()};
    if (path == "view.js") return {200, "text/javascript; charset=utf-8", ViewPageScript()};
    if (path == "scene.json")
      return {200, "application/json", ViewSceneJson(report_.scene, marks_, !page_.empty(), avatar_.any())};
    if (path == "alive" || path == "bye") return {200, "text/plain; charset=utf-8", ""};
    if (const auto step = NumbersOf(path, "step/", ".json", false); step && IsStep(step->second))
      return {200, "application/json", ViewStepJson(report_.scene, static_cast<int>(step->second))};
    if (const auto place = NumbersOf(path, "marks/", ".json", true)) return MarksAnswer(*place);
    if (const auto place = NumbersOf(path, "avatar/", ".png", true)) return AvatarAnswer(*place);
    if (const auto place = NumbersOf(path, "scored/", ".jpg", true)) return ScoredAnswer(*place);
    if (const auto image = NumbersOf(path, "image/", ".jpg", true)) return ImageAnswer(*image, 0);
    if (const auto image = NumbersOf(path, "thumb/", ".jpg", true)) return ImageAnswer(*image, kThumbPx);
    return NotHere();
  }

  bool is_over() const { return life_.is_over(); }

 private:
  PageAnswer MarksAnswer(const std::pair<int64_t, int64_t>& camera_and_step) {
    const auto [camera, step] = camera_and_step;
    if (static_cast<size_t>(camera) >= report_.scene.cameras.size() || !IsStep(step)) return NotHere();
    return {200, "application/json", ViewMarksJson(marks_.At(static_cast<size_t>(camera), static_cast<int>(step)))};
  }

  PageAnswer AvatarAnswer(const std::pair<int64_t, int64_t>& camera_and_step) {
    const auto [camera, step] = camera_and_step;
    if (static_cast<size_t>(camera) >= report_.scene.cameras.size() || !IsStep(step)) return NotHere();
    const std::string png = avatar_.At(static_cast<size_t>(camera), static_cast<int>(step));
    return png.empty() ? NotHere() : PageAnswer{200, "image/png", png};
  }

  /// Truth, render, error and nearest pose side by side.
  PageAnswer ScoredAnswer(const std::pair<int64_t, int64_t>& camera_and_step) {
    const auto [camera, step] = camera_and_step;
    const Scene& scene = report_.scene;
    if (static_cast<size_t>(camera) >= scene.cameras.size() || !IsStep(step)) return NotHere();
    const auto images = scene.scored.find(static_cast<int>(step));
    if (images == scene.scored.end()) return NotHere();
    const auto image = images->second.find(scene.cameras[static_cast<size_t>(camera)].name);
    if (image == images->second.end()) return NotHere();
    RequireInside(image->second, scene.root);
    return {200, "image/jpeg", dataset::EncodeImage(dataset::ReadImage(image->second), "scored.jpg")};
  }

  static bool IsStep(int64_t step) { return step <= std::numeric_limits<int>::max(); }

  PageAnswer ImageAnswer(const std::pair<int64_t, int64_t>& camera_and_step, int longer_side_px) {
    const auto [camera, step] = camera_and_step;
    const Scene& scene = report_.scene;
    if (static_cast<size_t>(camera) >= scene.cameras.size() || !IsStep(step)) return NotHere();
    const auto idx = static_cast<size_t>(camera);
    const std::string& jpeg =
        store_.Jpeg(scene.cameras[idx].footage, FrameAt(scene, idx, static_cast<int>(step)), longer_side_px);
    if (jpeg.empty()) return NotHere();
    ++report_.num_images;
    return {200, "image/jpeg", jpeg};
  }

  ViewReport& report_;
  std::string page_;
  MarksReader marks_;
  AvatarView avatar_;
  FrameStore store_;
  PageLife life_;
};

/// The report of what is shown; of a calibration of any program that of the rig, of points alone that of their motion, from a
/// folder that goes away.
std::string ReportPageOf(const Scene& scene, const std::string& path, const MakeReportPage& make) {
  try {
    if (!scene.report_folder.empty()) return make(scene.report_folder, "");
    if (scene.kind != "calibration" && scene.kind != "points") return {};
    const ScratchFolder scratch(std::filesystem::temp_directory_path().string());
    if (scene.kind == "calibration") {
      geometry::WriteRig(scene.rig, scratch.path() + "/calibration.json");
    } else {
      dataset::WritePose3d(dataset::ReadPoints3d(path), scratch.path());
    }
    return make(scratch.path(), scene.title);
  } catch (const IoError&) {  // nothing to report
    return {};
  }
}

}  // namespace

ViewReport RunView(const ViewOptions& options, const MakeReportPage& report, const ShowPage& show, const RunContext& run) {
  if (!(options.idle_min >= 0)) throw UsageError("option 'idle-min' must not be negative");
  if (!(options.cache_mb >= 0 && options.cache_mb <= 1e6)) throw UsageError("option 'cache-mb' must be in 0..1000000");
  const auto interrupted = [&] { return run.progress && run.progress->Cancelled(); };
  ViewReport result;
  result.options = options;
  if (IsMessagesFile(options.scene.path)) {
    RerunSite site(options, RerunFolder(options.rerun, options.scene.path));
    result.scene.kind = "messages", result.notes.inputs.push_back(options.scene.path);
    show([&](const PageRequest& request) { return site(request); }, [&] { return site.is_over() || interrupted(); });
    return result;
  }
  if (!options.rerun.empty()) throw UsageError("option 'rerun': " + options.scene.path + " is no .mcap file");
  result.scene = ReadScene(options.scene, &result.notes);
  const std::string page = ReportPageOf(result.scene, options.scene.path, report);
  result.has_report = !page.empty();
  if (page.empty() && result.scene.steps.empty() && result.scene.cameras.empty()) {
    const std::vector<Notice>& left_out = result.notes.warnings;
    if (!left_out.empty()) throw IoError(options.scene.path, "nothing to show: " + left_out.front().text);
    throw IoError(options.scene.path,
                  "holds neither footage, joints, a calibration nor results: nothing to show; give a session, a run, a "
                  "dataset, a calibration, points in 3D or videos");
  }
  ViewSite site(options, &result, page, ReadSolids(options.scene, {}, result.scene, &result.notes));
  show([&](const PageRequest& request) { return site(request); }, [&] { return site.is_over() || interrupted(); });
  return result;
}

}  // namespace mvstudio::stages
