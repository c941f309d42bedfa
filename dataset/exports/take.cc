#include "dataset/exports/take.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/choice/frame_choice.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/shortest_text.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/views/undistort.h"

namespace mvstudio::exports {
namespace {

bool AllowedInName(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
}

dataset::PartOfSplit PartOf(const dataset::Split& split, const std::string& camera) {
  const auto holds = [&](const dataset::SplitPart& part) {
    return std::find(part.cameras.begin(), part.cameras.end(), camera) != part.cameras.end();
  };
  using Part = dataset::PartOfSplit;
  return holds(split.test)         ? Part::kTest
         : holds(split.validation) ? Part::kValidation
         : holds(split.train)      ? Part::kTrain
                                   : Part::kNone;
}

/// Rig indices of the cameras that the options and the split name.
std::vector<size_t> ChooseCameras(const dataset::PanopticDataset& dataset, const ExportOptions& options,
                                  const std::optional<dataset::Split>& split) {
  std::set<std::string> wanted;
  for (const std::string& name : options.cameras) {
    const std::string resolved = dataset.Resolve(name);
    if (resolved.empty()) throw UsageError("option 'cameras': the dataset has no camera '" + name + "'");
    wanted.insert(resolved);
  }
  std::vector<size_t> chosen;
  for (size_t i = 0; i < dataset.rig.cameras.size(); ++i) {
    const std::string& name = dataset.rig.cameras[i].camera.name;
    if (!wanted.empty() && !wanted.count(name)) continue;
    if (split && PartOf(*split, name) == dataset::PartOfSplit::kNone) continue;
    chosen.push_back(i);
  }
  if (chosen.empty()) throw UsageError("no camera is left: option 'cameras' and option 'split' have none in common");
  return chosen;
}

std::vector<int> ChooseFrames(const dataset::PanopticDataset& dataset, const FormatInfo& format, const ExportOptions& options,
                              const std::optional<dataset::Split>& split, ExportReport* report) {
  FrameChoice choice = KnownFrames("option 'frames'", options.frames, dataset.frames, dataset.root + " (its joints)");
  if (!choice.beyond.empty())
    report->notes.push_back({"CLI-FRAMES", choice.beyond, "look at the numbers: a dataset's frames are those of its joints"});
  std::vector<int> chosen = std::move(choice.frames);
  if (!chosen.empty()) return chosen;
  chosen = dataset.frames;
  if (split) {
    std::set<int> used(split->train.frames.begin(), split->train.frames.end());
    for (const auto* part : {&split->validation, &split->test}) used.insert(part->frames.begin(), part->frames.end());
    chosen.assign(used.begin(), used.end());
  }
  if (format.one_time_step && !options.all_frames && chosen.size() > 1) {
    report->notes.push_back({"EXP-ONE-FRAME",
                             format.name + " describes one time step: frame " + std::to_string(chosen[0]) + " of " +
                                 std::to_string(chosen.size()) + " was taken",
                             "choose with option 'frames', or pass option 'frames' all for a folder per frame"});
    chosen.resize(1);
  }
  return chosen;
}

/// From the time stamps of the first and last frame; 29.97 where they say nothing.
double FrameRate(const dataset::PanopticDataset& dataset) {
  constexpr double kPanopticHz = 29.97;
  if (dataset.frames.size() < 2) return kPanopticHz;
  const auto files = dataset::ListBody3dScenes(dataset.root);
  const auto first = files.find(dataset.frames.front()), last = files.find(dataset.frames.back());
  if (first == files.end() || last == files.end()) return kPanopticHz;
  const double span_ms =
      dataset::ReadBody3dSceneFile(last->second).univ_time_ms - dataset::ReadBody3dSceneFile(first->second).univ_time_ms;
  if (!(span_ms > 0)) return kPanopticHz;
  return std::round(1e6 * 1000.0 * (last->first - first->first) / span_ms) / 1e6;
}

std::string LensText(LensNeed need) {
  return need == LensNeed::kPinhole ? "an ideal pinhole" : need == LensNeed::kBrown4 ? "k1, k2, p1, p2" : "k1, k2, p1, p2, k3";
}

/// The lens of the exported images, undistorted where the options say so.
void ChooseLens(const FormatInfo& format, const ExportOptions& options, View* view) {
  const geometry::Camera& lens = view->source.camera;
  view->camera = view->source;
  const bool carried = Carries(format.lens, lens);
  const bool distorted = !Carries(LensNeed::kPinhole, lens);
  if (!carried && options.undistort == ExportUndistort::kNever) {
    throw UsageError("camera " + lens.name + ": " + format.name + " describes " + LensText(format.lens) + ", not a lens " +
                     std::string(ToString(lens.model)) + "; leave out option 'undistort' never to have its images resampled");
  }
  const bool off_centre = options.undistort_view == dataset::UndistortView::kCentred && !dataset::IsCentred(lens);
  if (carried && !(options.undistort == ExportUndistort::kAlways && (distorted || off_centre))) return;
  dataset::UndistortOptions undistort;
  undistort.view = options.undistort_view;
  const dataset::UndistortedCamera ideal = dataset::IdealPinhole(view->source, undistort);
  if (!ideal.usable()) {
    throw FormatError("camera " + lens.name, "", "its images cannot be resampled to a pinhole: " + ideal.reason);
  }
  view->camera = ideal.camera;
  view->info.undistorted = true;
  view->info.lost_share = ideal.lost_share;
}

void RequireMasksFit(const FormatInfo& format, const ExportOptions& options) {
  if (options.masks != ExportMasks::kAlpha) return;
  if (!format.has_alpha)
    throw UsageError("option 'masks' alpha: readers of " + format.name + " take no alpha channel; colmap and nerfstudio do");
  if (options.images == ExportImages::kNone)
    throw UsageError("option 'masks' alpha needs images: leave out option 'pictures' none");
}

void NameViews(const dataset::PanopticDataset& dataset, const ExportOptions& options, std::vector<View>* views,
               ExportReport* report) {
  std::map<std::string, std::string> studio;
  for (const auto& [alias, name] : dataset.aliases) studio[name] = alias;
  std::vector<std::string> wanted;
  for (View& view : *views) {
    view.info.source = view.source.camera.name;
    const auto found = studio.find(view.info.source);
    if (found != studio.end()) view.info.studio = found->second;
    wanted.push_back(options.names == ExportNames::kStudio && !view.info.studio.empty() ? view.info.studio : view.info.source);
  }
  const std::vector<std::string> safe = SafeNames(wanted);
  int changed = 0;
  for (size_t i = 0; i < views->size(); ++i) {
    (*views)[i].info.name = (*views)[i].camera.camera.name = safe[i];
    changed += safe[i] != wanted[i];
  }
  if (changed > 0) {
    report->notes.push_back({"EXP-RENAMED",
                             std::to_string(changed) + " camera names cannot stand in file names and were changed",
                             "export.json says which is which"});
  }
}

void RequireOneSize(const FormatInfo& format, const std::vector<View>& views) {
  const geometry::Camera& first = views[0].camera.camera;
  for (const View& view : views) {
    const geometry::Camera& lens = view.camera.camera;
    if (lens.width_px == first.width_px && lens.height_px == first.height_px) continue;
    throw UsageError(format.name + " holds images of one size: " + first.name + " has " + std::to_string(first.width_px) + "x" +
                     std::to_string(first.height_px) + ", " + lens.name + " has " + std::to_string(lens.width_px) + "x" +
                     std::to_string(lens.height_px) + "; choose cameras of one size with option 'cameras'");
  }
}

void NoteUndistorted(const std::vector<View>& views, ExportReport* report) {
  int count = 0;
  const View* worst = nullptr;
  for (const View& view : views) {
    if (!view.info.undistorted) continue;
    ++count;
    if (!worst || view.info.lost_share > worst->info.lost_share) worst = &view;
  }
  if (!worst) return;
  const std::string text = Format("images of %d cameras are resampled to ideal pinholes; %s loses most, %.1f %% of its pixels",
                                  count, worst->info.source.c_str(), 100 * worst->info.lost_share);
  report->notes.push_back({"EXP-UNDISTORTED", text, "option 'undistort-view' all keeps every pixel, with black borders"});
}

}  // namespace

const People& Take::At(int frame) const {
  static const People nobody;
  const auto found = poses.find(frame);
  return found == poses.end() ? nobody : found->second;
}

std::vector<int> Take::PersonIds() const {
  std::set<int> ids;
  for (const int frame : frames) {
    for (const auto& [id, pose] : At(frame)) ids.insert(id);
  }
  return {ids.begin(), ids.end()};
}

std::vector<size_t> Take::ViewsOf(dataset::PartOfSplit part) const {
  std::vector<size_t> chosen;
  for (size_t i = 0; i < views.size(); ++i) {
    if (views[i].info.part == part || (!split && part == dataset::PartOfSplit::kTrain)) chosen.push_back(i);
  }
  return chosen;
}

std::optional<Eigen::Matrix<double, 5, 1>> Brown5Of(const geometry::Camera& camera) {
  const auto terms = geometry::OpenCvTerms(camera);
  if (!terms || camera.params.size() > 4 + 5) return std::nullopt;
  return terms->head<5>();
}

bool Carries(LensNeed need, const geometry::Camera& camera) {
  if (need == LensNeed::kAny) return true;
  const auto k = Brown5Of(camera);
  if (!k) return false;
  if (need == LensNeed::kBrown5) return true;
  if (need == LensNeed::kBrown4) return (*k)[4] == 0;
  return k->isZero(0);
}

std::vector<std::string> SafeNames(const std::vector<std::string>& names) {
  constexpr size_t kMaxLength = 64;
  std::set<std::string> taken;
  std::vector<std::string> safe;
  for (const std::string& name : names) {
    std::string text;
    for (const char c : name) {
      if (AllowedInName(c)) {
        text += c;
      } else if (text.empty() || text.back() != '_') {
        text += '_';
      }
    }
    text.resize(std::min(text.size(), kMaxLength));
    if (text.find_first_not_of("_-") == std::string::npos) text = "cam" + text;
    if (text[0] == '-') text = "cam" + text;
    std::string unique = text;
    for (int n = 2; !taken.insert(unique).second; ++n) unique = text + "_" + std::to_string(n);
    safe.push_back(unique);
  }
  return safe;
}

std::string Num(double value) { return ShortestText(value); }

std::string Numbered(const std::string& prefix, int number, int digits, const std::string& suffix) {
  return prefix + Format("%0*d", digits, number) + suffix;
}

double FloatRoundingM(const Take& take) {
  double largest = 0;
  for (const int frame : take.frames) {
    for (const auto& [id, pose] : take.At(frame)) {
      for (int j = 0; j < 19; ++j) {
        if (!pose.valid[j]) continue;
        const Eigen::Vector3d x = pose.x_in_world.col(j);
        largest = std::max(largest, (x - x.cast<float>().cast<double>()).norm());
      }
    }
  }
  if (!take.own) return largest;
  for (const auto& [frame, people] : take.own->poses) {
    for (const auto& [id, pose] : people) {
      const Eigen::Matrix3Xd rounded = pose.x_in_world.cast<float>().cast<double>();
      largest = std::max(largest, (pose.x_in_world - rounded).colwise().norm().maxCoeff());
    }
  }
  return largest;
}

Take PrepareTake(const dataset::PanopticDataset& dataset, const FormatInfo& format, const ExportOptions& options,
                 ExportReport* report) {
  if (options.jpeg_quality < 0 || options.jpeg_quality > 100) throw UsageError("option 'jpeg-quality' must be 0 to 100");
  RequireMasksFit(format, options);
  if (options.frame_rate_hz != 0 && !dataset::IsFrameRate(options.frame_rate_hz))
    throw UsageError(std::string("option 'frame-rate' ") + dataset::kFrameRates);
  Take take;
  take.sequence = SafeNames({dataset.sequence})[0];
  take.root = dataset.root, take.mask_folder = dataset.mask_folder;
  if (!options.split.empty()) {
    take.split = dataset::ReadSplit(options.split);
    dataset::RequireSplitOf(*take.split, dataset, options.split);
  }
  for (const size_t i : ChooseCameras(dataset, options, take.split)) {
    View view;
    view.source = dataset.rig.cameras[i];
    if (take.split) view.info.part = PartOf(*take.split, view.source.camera.name);
    ChooseLens(format, options, &view);
    take.views.push_back(std::move(view));
  }
  NameViews(dataset, options, &take.views, report);
  if (format.one_size) RequireOneSize(format, take.views);
  NoteUndistorted(take.views, report);
  take.frames = ChooseFrames(dataset, format, options, take.split, report);
  for (const int frame : take.frames) {
    const auto found = dataset.poses.find(frame);
    if (found != dataset.poses.end()) take.poses[frame] = found->second;
  }
  take.own = dataset.own;
  take.frame_rate_hz = options.frame_rate_hz > 0 ? options.frame_rate_hz : FrameRate(dataset);
  return take;
}

Take TakeOfRig(const geometry::Rig& rig, const FormatInfo& format, const std::string& path, ExportReport* report) {
  Take take;
  take.sequence = "rig";
  std::vector<std::string> wanted;
  for (const geometry::RigCamera& camera : rig.cameras) {
    if (!Carries(format.lens, camera.camera)) {
      throw FormatError(path, camera.camera.name,
                        format.name + " describes " + LensText(format.lens) + ", not a lens " +
                            std::string(ToString(camera.camera.model)) +
                            "; `dataset export` resamples the images, or write option 'to' mvstudio and keep the lens");
    }
    View view;
    view.source = view.camera = camera;
    view.info.source = view.info.studio = camera.camera.name;
    wanted.push_back(camera.camera.name);
    take.views.push_back(std::move(view));
  }
  const std::vector<std::string> safe = SafeNames(wanted);
  std::string changed;
  for (size_t i = 0; i < safe.size(); ++i) {
    take.views[i].info.name = take.views[i].camera.camera.name = safe[i];
    if (safe[i] != wanted[i]) changed += (changed.empty() ? "'" : ", '") + wanted[i] + "' is " + safe[i];
  }
  if (!changed.empty()) report->notes.push_back({"EXP-RENAMED", "camera names were changed: " + changed, ""});
  if (format.one_size) RequireOneSize(format, take.views);
  return take;
}

}  // namespace mvstudio::exports
