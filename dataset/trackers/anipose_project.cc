#include <toml++/toml.h>

#include <filesystem>
#include <map>
#include <optional>
#include <regex>
#include <set>

#include "core/disk/files.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/toml_depth.h"
#include "dataset/trackers/project_readers.h"

namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

/// What config.toml says; the defaults are anipose's.
struct Config {
  std::string path;
  int nesting = 1;
  std::string pose = "pose-2d", filtered = "pose-2d-filtered", calibration = "calibration", camera_regex = "-cam([A-Z])";
  bool filter = false;
  double board_square = 0;
  std::vector<std::pair<std::string, std::string>> bones;
  std::vector<std::string> unused;
  ProjectSettings settings;
};

/// Keys, with those of the tables in it, that are neither used here nor without effect on where points are.
void AddUnused(const toml::table& table, const std::string& above, std::vector<std::string>* unused) {
  static const std::set<std::string> kKnown = {"nesting",
                                               "project",
                                               "model_folder",
                                               "video_extension",
                                               "converted_video_speed",
                                               "pipeline",
                                               "cameras",
                                               "calibration",
                                               "labeling",
                                               "filter.enabled",
                                               "triangulation.cam_regex",
                                               "triangulation.triangulate",
                                               "triangulation.constraints",
                                               "triangulation.axes",
                                               "triangulation.reference_point",
                                               "triangulation.score_threshold",
                                               "angles"};
  for (const auto& [key, node] : table) {
    const std::string name = above + std::string(key.str());
    if (kKnown.count(name) > 0) continue;
    const toml::table* inner = node.as_table();
    if (inner)
      AddUnused(*inner, name + ".", unused);
    else
      unused->push_back(name);
  }
}

toml::table Parse(const std::string& path) {
  const std::string text = ReadFile(path);
  RequireParsableToml(text, path);
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw FormatError(path, "line " + std::to_string(error.source().begin.line), std::string(error.description()));
  }
}

void RefuseCrops(const toml::table& root, const std::string& path) {
  const toml::table* cameras = root.get_as<toml::table>("cameras");
  if (!cameras) return;
  for (const auto& [name, node] : *cameras) {
    const toml::table* camera = node.as_table();
    const toml::array* offset = camera ? camera->get_as<toml::array>("offset") : nullptr;
    for (size_t i = 0; offset && i < offset->size(); ++i) {
      if ((*offset)[i].value_or(0.0) == 0) continue;
      throw FormatError(path, "cameras." + std::string(name.str()) + ".offset",
                        "its videos were cropped, which is not read from a project; give the files by option 'pose2d' and a "
                        "calibration whose centres are shifted by the offset");
    }
  }
}

/// Joints that follow each other in a list of lists of names; what is no name ends a line.
std::vector<std::pair<std::string, std::string>> Lines(const toml::table& root, const char* key) {
  std::vector<std::pair<std::string, std::string>> bones;
  const toml::array* lists = root.at_path(key).as_array();
  for (size_t i = 0; lists && i < lists->size(); ++i) {
    const toml::array* line = (*lists)[i].as_array();
    for (size_t k = 1; line && k < line->size(); ++k) {
      const auto from = (*line)[k - 1].value_exact<std::string>(), to = (*line)[k].value_exact<std::string>();
      if (from && to) bones.emplace_back(*from, *to);
    }
  }
  return bones;
}

/// Two directions between points, as `[["x", "tail", "nose"], ["z", "paw", "ear"]]`.
void ReadAxes(const toml::table& root, const std::string& path, ProjectSettings* settings) {
  const toml::array* axes = root.at_path("triangulation.axes").as_array();
  if (!axes || axes->empty()) return;
  const auto fail = [&] {
    throw FormatError(path, "triangulation.axes", "is not two of [axis, from, to], with axes x, y or z that differ");
  };
  for (const toml::node& node : *axes) {
    const toml::array* entry = node.as_array();
    if (!entry || entry->size() != 3) fail();
    const auto axis = (*entry)[0].value<std::string>(), from = (*entry)[1].value<std::string>(),
               to = (*entry)[2].value<std::string>();
    if (!axis || !from || !to || (*axis != "x" && *axis != "y" && *axis != "z") || *from == *to) fail();
    settings->axes.push_back({(*axis)[0], *from, *to});
  }
  if (settings->axes.size() != 2 || settings->axes[0].axis == settings->axes[1].axis) fail();
}

/// `[angles]`: name = ["hinge", a, b, c], or the three points alone. Others are not used.
void ReadAngles(const toml::table& root, Config* config) {
  const toml::table* angles = root.get_as<toml::table>("angles");
  if (!angles) return;
  for (const auto& [name, node] : *angles) {
    std::vector<std::string> words;
    const toml::array* list = node.as_array();
    for (size_t i = 0; list && i < list->size(); ++i) words.push_back((*list)[i].value_or(std::string()));
    const bool other_kind = !words.empty() && (words[0] == "flex" || words[0] == "axis");
    if (words.size() == 4 && words[0] == "hinge") words.erase(words.begin());
    if (words.size() == 3 && !other_kind)
      config->settings.angles.push_back({std::string(name.str()), {words[0], words[1], words[2]}});
    else
      config->unused.push_back("angles." + std::string(name.str()) + (words.empty() ? "" : " (" + words[0] + ")"));
  }
}

Config ReadConfig(const std::string& folder) {
  Config config;
  config.path = (fs::path(folder) / "config.toml").string();
  const toml::table root = Parse(config.path);
  const auto text = [&](const char* key, std::string* value) { *value = root.at_path(key).value_or(*value); };
  config.nesting = root.at_path("nesting").value_or(config.nesting);
  text("pipeline.pose_2d", &config.pose), text("pipeline.pose_2d_filter", &config.filtered);
  text("pipeline.calibration_results", &config.calibration), text("triangulation.cam_regex", &config.camera_regex);
  config.filter = root.at_path("filter.enabled").value_or(false);
  config.board_square = root.at_path("calibration.board_square_side_length").value_or(0.0);
  config.bones = Lines(root, "triangulation.constraints");
  if (config.bones.empty()) config.bones = Lines(root, "labeling.scheme");
  AddUnused(root, "", &config.unused);
  ReadAxes(root, config.path, &config.settings);
  ReadAngles(root, &config);
  config.settings.reference_point = root.at_path("triangulation.reference_point").value_or(std::string());
  config.settings.min_score = root.at_path("triangulation.score_threshold").value<double>();
  RefuseCrops(root, config.path);
  return config;
}

/// The camera's name in a file's name, and what is left of it: the video's. Python's `re` and ECMAScript agree in what such
/// expressions use.
class CameraNames {
 public:
  explicit CameraNames(const Config& config) {
    constexpr size_t kLongest = 100;
    try {
      if (config.camera_regex.size() > kLongest) throw std::regex_error(std::regex_constants::error_complexity);
      regex_ = std::regex(config.camera_regex);
    } catch (const std::regex_error&) {
      throw FormatError(config.path, "triangulation.cam_regex", "`" + config.camera_regex + "` is no regular expression");
    }
    if (regex_.mark_count() < 1) {
      throw FormatError(config.path, "triangulation.cam_regex",
                        "`" + config.camera_regex + "` has no group (…) around the camera's name");
    }
  }

  struct Parts {
    std::string camera, video;
  };
  std::optional<Parts> Split(const std::string& stem) const {
    std::smatch match;
    try {
      if (!std::regex_search(stem, match, regex_)) return std::nullopt;
      return Parts{Trim(match[1].str()), Trim(std::regex_replace(stem, regex_, ""))};
    } catch (const std::regex_error&) {
      return std::nullopt;
    }
  }

 private:
  static std::string Trim(const std::string& text) {
    const size_t begin = text.find_first_not_of(' '), end = text.find_last_not_of(' ');
    return begin == std::string::npos ? "" : text.substr(begin, end - begin + 1);
  }
  std::regex regex_;
};

/// calibration.toml of the session or of a folder above it, the project's at last; empty when there is none.
std::string CalibrationOf(const Config& config, const fs::path& project, fs::path session) {
  for (;; session = session.parent_path()) {
    const fs::path path = session / config.calibration / "calibration.toml";
    std::error_code error;
    if (fs::is_regular_file(path, error)) return path.string();
    if (session == project || !session.has_relative_path()) return "";
  }
}

/// Folders `nesting` levels below; of a negative nesting, all.
std::vector<std::string> Sessions(const std::string& folder, int nesting, int depth = 0) {
  constexpr int kMaxDepth = 8;
  std::vector<std::string> sessions;
  if (nesting < 0 || nesting == depth) sessions.push_back(folder);
  if (depth >= kMaxDepth || (nesting >= 0 && depth >= nesting)) return sessions;
  for (const std::string& below : ListFolder(folder, true)) {
    const std::vector<std::string> found = Sessions(below, nesting, depth + 1);
    sessions.insert(sessions.end(), found.begin(), found.end());
  }
  return sessions;
}

/// Files of 2D points in a session: those of the filter where it is enabled and has run.
std::vector<std::string> PoseFiles(const Config& config, const fs::path& session, bool* filtered) {
  for (const bool use_filtered : {true, false}) {
    if (use_filtered && !config.filter) continue;
    const fs::path folder = session / (use_filtered ? config.filtered : config.pose);
    std::error_code error;
    if (!fs::is_directory(folder, error)) continue;
    std::vector<std::string> files;
    for (const std::string& path : ListFolder(folder.string(), false)) {
      if (fs::path(path).extension() == ".h5") files.push_back(path);
    }
    *filtered = use_filtered;
    if (!files.empty()) return files;
  }
  return {};
}

void AddTakes(const Config& config, const CameraNames& names, const fs::path& project_folder, const std::string& session,
              TrackedProject* project) {
  bool filtered = false;
  std::map<std::string, std::vector<TrackedProject::CameraFile>> videos;
  for (const std::string& path : PoseFiles(config, session, &filtered)) {
    const auto parts = names.Split(fs::path(path).stem().string());
    if (parts) {
      videos[parts->video].push_back({parts->camera, path});
    } else {
      project->left_out.push_back(path + ": its name holds no camera as triangulation.cam_regex says");
    }
  }
  const std::string calibration = CalibrationOf(config, project_folder, session);
  const std::string inside = fs::path(session).lexically_relative(project_folder).generic_string();
  for (auto& [video, files] : videos) {
    const std::string name = inside == "." ? video : inside + "/" + video;
    if (files.size() < 2) {
      project->left_out.push_back(files[0].path + ": no other camera has a file of take `" + name + "`");
    } else if (calibration.empty()) {
      project->left_out.push_back(files[0].path + ": no " + config.calibration +
                                  "/calibration.toml in its session or above it; run anipose calibrate");
    } else {
      project->takes.push_back({name, calibration, std::move(files), "", filtered});
    }
  }
}

}  // namespace

TrackedProject ReadAniposeProject(const std::string& folder) {
  const Config config = ReadConfig(folder);
  const CameraNames names(config);
  TrackedProject project;
  project.program = "anipose";
  project.board_square = config.board_square, project.bones = config.bones, project.unused = config.unused;
  project.settings = config.settings;
  const fs::path root = PlainPath(folder);
  const fs::path project_folder = root.has_filename() ? root : root.parent_path();
  for (const std::string& session : Sessions(project_folder.string(), config.nesting)) {
    AddTakes(config, names, project_folder, session, &project);
  }
  if (!project.takes.empty()) return project;
  throw FormatError(folder, "",
                    project.left_out.empty()
                        ? "no " + config.pose + "/*.h5 in its sessions (" + std::to_string(config.nesting) +
                              " folders deep, as config.toml's `nesting` says); run anipose analyze"
                        : project.left_out[0]);
}

}  // namespace mvstudio::dataset::internal
