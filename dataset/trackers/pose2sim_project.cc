#include <toml++/toml.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "core/disk/files.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/text/shortest_text.h"
#include "core/toml_depth.h"
#include "dataset/trackers/project_readers.h"

/// Pose2Sim (github.com/perfanalytics/pose2sim): its Config.toml and folders, as its README describes them.
namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

toml::table ParseConfig(const std::string& path) {
  const std::string text = ReadFile(path);
  RequireParsableToml(text, path);
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw FormatError(path, "line " + std::to_string(error.source().begin.line), std::string(error.description()));
  }
}

constexpr int kMostAbove = 3;

/// The folder's own and those above it, which fill in what it lacks.
class Configs {
 public:
  explicit Configs(fs::path folder) {
    std::error_code error;
    for (int level = 0; level <= kMostAbove && folder.has_relative_path(); ++level, folder = folder.parent_path()) {
      const fs::path path = folder / "Config.toml";
      if (fs::is_regular_file(path, error)) tables_.push_back(ParseConfig(path.string()));
    }
  }
  bool empty() const { return tables_.empty(); }

  toml::node_view<const toml::node> At(const char* key) const {
    for (const toml::table& table : tables_) {
      const auto node = table.at_path(key);
      if (node) return node;
    }
    return toml::node_view<const toml::node>();
  }
  std::optional<double> Number(const char* key) const { return At(key).value<double>(); }
  std::string Text(const char* key) const { return At(key).value_or(std::string()); }

  /// Keys of the sections that change results.
  std::set<std::string> Keys() const {
    std::set<std::string> keys;
    for (const toml::table& table : tables_) {
      for (const char* section : {"project", "personAssociation", "triangulation", "filtering", "markerAugmentation"}) {
        const toml::table* inner = table.get_as<toml::table>(section);
        if (!inner) continue;
        for (const auto& [key, node] : *inner) {
          if (!node.is_table()) keys.insert(std::string(section) + "." + std::string(key.str()));
        }
      }
    }
    return keys;
  }

 private:
  std::vector<toml::table> tables_;
};

/// Settings that change nothing here, or that are done without being asked.
const std::set<std::string>& WithoutEffect() {
  static const std::set<std::string> keys = {"project.exclude_from_batch",
                                             "project.project_dir",
                                             "filtering.display_figures",
                                             "filtering.filter",
                                             "filtering.type",
                                             "filtering.make_c3d",
                                             "filtering.save_filt_plots",
                                             "triangulation.show_interp_indices",
                                             "triangulation.make_c3d",
                                             "triangulation.likelihood_threshold_triangulation",
                                             "triangulation.min_cameras_for_triangulation",
                                             "triangulation.interpolation",
                                             "triangulation.interp_if_gap_smaller_than",
                                             "project.frame_rate",
                                             "project.frame_range",
                                             "personAssociation.single_person"};
  return keys;
}

std::string SkeletonOfModel(std::string model) {
  std::transform(model.begin(), model.end(), model.begin(), [](unsigned char c) { return std::toupper(c); });
  static const std::map<std::string, std::string> names = {
      {"BODY_25B", "body25b"},   {"BODY_25", "body25"},         {"BODY_135", "body135"},   {"COCO", "coco18"},
      {"HALPE_26", "halpe26"},   {"BODY_WITH_FEET", "halpe26"}, {"HALPE_136", "halpe136"}, {"COCO_133", "coco133"},
      {"WHOLE_BODY", "coco133"}, {"COCO_17", "coco17"},         {"BODY", "coco17"},        {"BLAZEPOSE", "mediapipe33"}};
  const auto found = names.find(model);
  return found == names.end() ? "" : found->second;
}

void ReadProjectPart(const Configs& configs, TrackedProject* project) {
  ProjectSettings& settings = project->settings;
  const std::optional<double> rate_hz = configs.Number("project.frame_rate");
  if (rate_hz && *rate_hz > 0) settings.frame_rate_hz = rate_hz;
  const toml::array* range = configs.At("project.frame_range").as_array();
  if (range && range->size() == 2) {
    const auto first = (*range)[0].value<int64_t>(), end = (*range)[1].value<int64_t>();
    if (!first || !end || *first < 0 || *end <= *first || *end > 1'000'000'000)
      throw FormatError("Config.toml", "project.frame_range", "is not [first, end]");
    settings.frames = std::to_string(*first) + "-" + std::to_string(*end - 1);
    project->notes.push_back("project.frame_range ends before its second number: frames " + settings.frames);
  }
  const std::string model = configs.Text("pose.pose_model");
  settings.skeleton = SkeletonOfModel(model);
  if (!model.empty() && settings.skeleton.empty()) project->unused.push_back("pose.pose_model (" + model + ")");
}

void ReadTriangulationPart(const Configs& configs, TrackedProject* project) {
  ProjectSettings& settings = project->settings;
  settings.min_score = configs.Number("triangulation.likelihood_threshold_triangulation");
  const std::optional<double> cameras = configs.Number("triangulation.min_cameras_for_triangulation");
  if (cameras) settings.min_views = static_cast<int>(*cameras);
  const std::string interpolation = configs.Text("triangulation.interpolation");
  if (interpolation.empty()) return;
  if (interpolation == "none") {
    settings.fill_frames = 0;
    return;
  }
  const std::optional<double> gap = configs.Number("triangulation.interp_if_gap_smaller_than");
  settings.fill_frames = gap ? static_cast<int>(*gap) : 0;
  if (interpolation != "cubic") project->notes.push_back("gaps are filled by cubics, not as `" + interpolation + "`");
}

void ReadFilterPart(const Configs& configs, TrackedProject* project) {
  const std::string type = configs.Text("filtering.type");
  if (type.empty() || !configs.At("filtering.filter").value_or(true)) return;
  std::string& filter = project->settings.filter;
  const auto number = [&](const char* key) { return configs.Number(key).value_or(std::nan("")); };
  if (type == "butterworth") {
    const double cut_hz = number("filtering.butterworth.cut_off_frequency"), order = number("filtering.butterworth.order");
    if (cut_hz > 0) filter = "butterworth:" + ShortestText(cut_hz) + "Hz";
    if (order != 4 && std::isfinite(order)) project->unused.push_back("filtering.butterworth.order (4 is used)");
    project->notes.push_back("the cut-off is that of both passes together; Pose2Sim's own filter cuts at 0.8 of it");
  } else if (type == "gaussian" && number("filtering.gaussian.sigma_kernel") > 0) {
    filter = "gaussian-frames:" + ShortestText(number("filtering.gaussian.sigma_kernel"));
  } else if (type == "median" && number("filtering.median.kernel_size") > 0) {
    filter = "median:" + ShortestText(number("filtering.median.kernel_size"));
  } else if (type == "kalman") {
    filter = "kalman";
    project->unused.push_back("filtering.kalman (each point's own sigma is used)");
  } else {
    project->unused.push_back("filtering.type (" + type + ")");
  }
}

/// Small letters and digits, numbers without leading zeros: "cam_01" and "Cam1" are the same camera.
std::string CameraKey(const std::string& name) {
  std::string key;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (!std::isalnum(byte)) continue;
    const bool digit_before = !key.empty() && std::isdigit(static_cast<unsigned char>(key.back()));
    if (c == '0' && !digit_before) {
      key += c;
      continue;
    }
    if (digit_before && key.back() == '0' &&
        (key.size() < 2 || !std::isdigit(static_cast<unsigned char>(key[key.size() - 2]))) && std::isdigit(byte))
      key.pop_back();
    key += static_cast<char>(std::tolower(byte));
  }
  return key;
}

std::string CameraOfFolder(const fs::path& folder) {
  std::string name = folder.filename().string();
  for (const char* end : {"_json", "-json", "json"}) {
    const size_t length = std::string(end).size();
    if (name.size() > length && name.compare(name.size() - length, length, end) == 0) {
      name.resize(name.size() - length);
      break;
    }
  }
  return name.rfind("pose_", 0) == 0 ? name.substr(5) : name;
}

std::vector<std::string> CamerasOfCalibration(const std::string& path) {
  std::vector<std::string> names;
  for (const auto& [key, node] : ParseConfig(path)) {
    const toml::table* camera = node.as_table();
    if (camera && camera->contains("matrix")) names.push_back((*camera)["name"].value_or(std::string(key.str())));
  }
  return names;
}

/// The nearest folder calib…, of the trial or above it, with a .toml; empty: none. Several files are a matter of option
/// 'calib'.
std::string CalibrationOfTrial(fs::path folder) {
  std::error_code error;
  for (int level = 0; level <= kMostAbove && folder.has_relative_path(); ++level, folder = folder.parent_path()) {
    for (const std::string& inner : ListFolder(folder.string(), true)) {
      std::string name = fs::path(inner).filename().string();
      std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
      if (name.rfind("calib", 0) != 0) continue;
      std::vector<std::string> files;
      for (const std::string& file : ListFolder(inner, false)) {
        if (fs::path(file).extension() == ".toml") files.push_back(file);
      }
      if (files.size() > 1)
        throw FormatError(inner, "",
                          "holds several .toml files; name the calibration by option 'calib', or move the others away");
      if (files.size() == 1) return files[0];
    }
  }
  return "";
}

/// Folders of JSON files of the trial: what its last step wrote.
std::vector<std::string> PoseFolders(const fs::path& trial) {
  std::error_code error;
  for (const char* step : {"pose-associated", "pose-sync", "pose"}) {
    if (!fs::is_directory(trial / step, error)) continue;
    std::vector<std::string> folders;
    for (const std::string& folder : ListFolder((trial / step).string(), true)) {
      const std::string name = fs::path(folder).filename().string();
      if (name.size() > 4 && name.compare(name.size() - 4, 4, "json") == 0) folders.push_back(folder);
    }
    if (!folders.empty()) return folders;
  }
  return {};
}

/// Cameras by their names, by names that differ in case, `_` and zeros only, else by their order.
std::vector<TrackedProject::CameraFile> CamerasOfTrial(const std::vector<std::string>& folders, const std::string& calibration,
                                                       TrackedProject* project) {
  std::vector<std::string> known = CamerasOfCalibration(calibration);
  std::vector<TrackedProject::CameraFile> files;
  for (const std::string& folder : folders) {
    const std::string own = CameraOfFolder(folder);
    for (const std::string& name : known) {
      if (name == own || CameraKey(name) == CameraKey(own)) {
        files.push_back({name, folder});
        break;
      }
    }
  }
  std::set<std::string> distinct;
  for (const auto& file : files) distinct.insert(file.camera);
  if (distinct.size() == folders.size()) return files;
  if (known.size() != folders.size()) {
    throw FormatError(
        calibration, "",
        Format("has %zu cameras, the trial has 2D joints of %zu, and their names differ; option 'calib' and option "
               "'pose2d' CAMERA=FOLDER say which belong together",
               known.size(), folders.size()));
  }
  files.clear();
  std::sort(known.begin(), known.end());
  for (size_t i = 0; i < folders.size(); ++i) files.push_back({known[i], folders[i]});
  project->notes.push_back("names of the 2D joints' folders are not those of the calibration: they go by their order");
  return files;
}

void AddTrials(const fs::path& folder, const fs::path& root, int depth, TrackedProject* project) {
  const std::vector<std::string> folders = PoseFolders(folder);
  if (folders.size() >= 2) {
    std::string calibration;
    std::vector<TrackedProject::CameraFile> files;
    try {
      calibration = CalibrationOfTrial(folder);
      if (!calibration.empty()) files = CamerasOfTrial(folders, calibration, project);
    } catch (const FormatError& error) {
      project->left_out.push_back(folder.string() + ": " + error.what());
      return;
    }
    const std::string inside = folder.lexically_relative(root).generic_string();
    if (calibration.empty()) {
      project->left_out.push_back(folder.string() +
                                  ": no folder calib… with a .toml in it or above it; run Pose2Sim.calibration()");
    } else {
      project->takes.push_back({inside == "." ? folder.filename().string() : inside, calibration, std::move(files), "", false});
    }
    return;
  }
  if (depth >= kMostAbove) return;
  for (const std::string& below : ListFolder(folder.string(), true)) AddTrials(below, root, depth + 1, project);
}

}  // namespace

bool IsPose2SimProject(const std::string& folder) {
  fs::path path = fs::absolute(PlainPath(folder)).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  std::error_code error;
  if (fs::is_regular_file(path / "Config.toml", error)) return true;
  return !PoseFolders(path).empty() && !Configs(path).empty();
}

TrackedProject ReadPose2SimProject(const std::string& folder) {
  TrackedProject project;
  project.program = "Pose2Sim";
  fs::path root = fs::absolute(PlainPath(folder)).lexically_normal();
  if (!root.has_filename()) root = root.parent_path();
  const Configs configs(root);
  ReadProjectPart(configs, &project);
  ReadTriangulationPart(configs, &project);
  ReadFilterPart(configs, &project);
  for (const std::string& key : configs.Keys()) {
    if (WithoutEffect().count(key) == 0) project.unused.push_back(key);
  }
  AddTrials(root, root, 0, &project);
  if (!project.takes.empty()) return project;
  throw FormatError(folder, "",
                    project.left_out.empty()
                        ? "no trial with pose/CAMERA_json folders of two cameras; run Pose2Sim.poseEstimation()"
                        : project.left_out[0]);
}

}  // namespace mvstudio::dataset::internal
