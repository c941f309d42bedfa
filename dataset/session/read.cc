#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/toml_depth.h"
#include "dataset/footage/frame_rate.h"
#include "dataset/json/json_file.h"
#include "dataset/session/session.h"
#include "dataset/session/session_scan.h"
#include "dataset/session/trust.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

constexpr char kSchema[] = "mvstudio.session/1";
constexpr uintmax_t kMaxBytes = 16u << 20;

/// A table of the file and where it stands.
class TableView {
 public:
  TableView(const std::string& path, const toml::table& table, std::string where, std::vector<std::string>* warnings)
      : path_(&path), table_(&table), where_(std::move(where)), warnings_(warnings) {}

  [[noreturn]] void Fail(const std::string& key, const std::string& what) const { throw FormatError(*path_, Place(key), what); }

  std::string Text(const std::string& key, const std::string& missing = "") {
    const toml::node* node = Get(key);
    if (!node) return missing;
    const auto text = node->value_exact<std::string>();
    if (!text) Fail(key, "must be a text in quotes");
    return *text;
  }

  std::optional<double> Number(const std::string& key) {
    const toml::node* node = Get(key);
    if (!node) return std::nullopt;
    const auto number = node->value<double>();
    if (!node->is_number() || !number || !std::isfinite(*number)) Fail(key, "must be a finite number");
    return number;
  }

  bool Flag(const std::string& key) {
    const toml::node* node = Get(key);
    if (!node) return false;
    if (!node->is_boolean()) Fail(key, "must be true or false");
    return *node->value<bool>();
  }

  const toml::node* Get(const std::string& key) {
    known_.insert(key);
    return table_->get(key);
  }

  TableView Table(const std::string& key, const toml::table& table) const {
    return {*path_, table, where_.empty() ? key : where_ + "." + key, warnings_};
  }

  void WarnOfOthers() const {
    for (const auto& [key, node] : *table_) {
      const std::string name(key.str());
      if (!known_.count(name)) warnings_->push_back(*path_ + ": " + Place(name) + ": unknown key, not used");
    }
  }

  const std::string& path() const { return *path_; }
  const std::string& where() const { return where_; }
  const toml::table& table() const { return *table_; }

 private:
  std::string Place(const std::string& key) const {
    const toml::node* node = table_->get(key);
    const toml::source_position at = node ? node->source().begin : table_->source().begin;
    std::ostringstream place;
    if (at.line > 0) place << "line " << at.line << ", column " << at.column << ": ";
    place << where_ << (where_.empty() || key.empty() ? "" : ".") << key;
    return place.str();
  }

  const std::string* path_;
  const toml::table* table_;
  std::string where_;
  std::vector<std::string>* warnings_;
  std::set<std::string> known_;
};

void CheckName(const TableView& view, const std::string& key, const std::string& name) {
  const std::string why = WhyNotAName(name);
  if (!why.empty()) view.Fail(key, internal::Quoted(name) + " " + why + ": it cannot be a name");
}

std::optional<double> Rate(TableView& view) {
  const auto rate = view.Number("fps_hz");
  if (rate && !IsFrameRate(*rate)) view.Fail("fps_hz", kFrameRates);
  return rate;
}

void ReadSize(TableView& view, SessionCamera* camera) {
  const toml::node* node = view.Get("size_px");
  if (!node) return;
  const toml::array* size = node->as_array();
  const auto side = [&](size_t i) { return size->get(i)->value_exact<int64_t>().value_or(0); };
  if (!size || size->size() != 2 || side(0) < 1 || side(1) < 1 || side(0) > 1'000'000 || side(1) > 1'000'000) {
    view.Fail("size_px", "must be [width, height], whole pixels");
  }
  camera->width_px = static_cast<int>(side(0)), camera->height_px = static_cast<int>(side(1));
}

SessionCamera ReadCamera(TableView view) {
  SessionCamera camera;
  camera.name = view.Text("name");
  CheckName(view, "name", camera.name);
  camera.serial = view.Text("serial");
  camera.lens = view.Text("lens");
  ReadSize(view, &camera);
  view.WarnOfOthers();
  return camera;
}

/// Calls `each(table view, index)` for an array of tables, or `name(text, index)` for a plain name in it.
template <class Each, class Name>
void ForEachEntry(TableView& top, const std::string& key, const Each& each, const Name& name) {
  const toml::node* node = top.Get(key);
  if (!node) return;
  const toml::array* array = node->as_array();
  if (!array) top.Fail(key, "must be a list: [[" + key + "]] or " + key + " = [\"NAME\", …]");
  for (size_t i = 0; i < array->size(); ++i) {
    const std::string where = key + "[" + std::to_string(i) + "]";
    if (const toml::table* table = array->get_as<toml::table>(i)) {
      each(top.Table(where, *table));
    } else if (const auto text = array->get(i)->value_exact<std::string>()) {
      CheckName(top, key, *text);
      name(*text);
    } else {
      top.Fail(key, where + " must be a name or a table");
    }
  }
}

void AddFootage(const Session& session, const TableView& view, const std::string& camera, SessionTake* take) {
  if (session.FindCamera(camera) < 0)
    view.Fail(camera, "take " + take->name + " has footage of a camera that 'cameras' does not list");
  for (const SessionFootage& footage : take->footage) {
    if (footage.camera == camera) return;
  }
  take->footage.push_back({camera, "", ""});
}

std::string Expanded(std::string pattern, const std::string& camera) {
  constexpr char kHole[] = "{camera}";
  for (size_t at = 0; (at = pattern.find(kHole, at)) != std::string::npos; at += camera.size()) {
    pattern.replace(at, sizeof(kHole) - 1, camera);
  }
  return pattern;
}

/// `key` is a table of camera and path, or one text with `{camera}` for all cameras. Sets `path(footage)`.
template <class Path>
void ReadPaths(TableView& view, const std::string& key, const Session& session, SessionTake* take, const Path& path) {
  const toml::node* node = view.Get(key);
  if (!node) return;
  std::vector<std::pair<std::string, std::string>> paths;
  if (const auto text = node->value_exact<std::string>()) {
    if (text->find("{camera}") == std::string::npos) view.Fail(key, "one path for all cameras must hold {camera}");
    for (const SessionCamera& camera : session.cameras) paths.emplace_back(camera.name, Expanded(*text, camera.name));
  } else if (const toml::table* table = node->as_table()) {
    TableView inner = view.Table(key, *table);
    for (const auto& [camera, value] : *table) {
      const std::string name(camera.str()), file = inner.Text(name);
      if (file.empty() || file.find('\0') != std::string::npos) inner.Fail(name, "must be a path");
      if (key == "footage") AddFootage(session, inner, name, take);
      if (session.FindCamera(name) < 0) inner.Fail(name, "is a camera that 'cameras' does not list");
      paths.emplace_back(name, file);
    }
  } else {
    view.Fail(key, "must be a table CAMERA = PATH, or a path with {camera}");
  }
  for (const auto& [camera, file] : paths) {
    if (key == "footage") AddFootage(session, view, camera, take);
    for (SessionFootage& footage : take->footage) {
      if (footage.camera == camera) path(&footage) = file;
    }
  }
}

void Sort(const Session& session, SessionTake* take) {
  std::sort(take->footage.begin(), take->footage.end(), [&](const SessionFootage& a, const SessionFootage& b) {
    return session.FindCamera(a.camera) < session.FindCamera(b.camera);
  });
}

SessionTake FoundTake(const Session& session, const std::string& name) {
  SessionTake take;
  take.name = name;
  if (name == "board") take.kind = TakeKind::kBoard;
  take.footage = internal::ScanFootage(session, name);
  return take;
}

SessionTake ReadTake(TableView view, const Session& session) {
  const std::string name = view.Text("name");
  CheckName(view, "name", name);
  SessionTake take;
  take.name = name;
  const std::optional<TakeKind> kind = TakeKindFromString(view.Text("kind", name == "board" ? "board" : "people"));
  if (!kind) view.Fail("kind", "must be people, board or plate");
  take.kind = *kind;
  take.fps_hz = Rate(view);
  take.timestamps = view.Text("timestamps");
  take.sync = view.Text("sync");
  if (!view.table().contains("footage")) take.footage = internal::ScanFootage(session, name);
  ReadPaths(view, "footage", session, &take, [](SessionFootage* f) -> std::string& { return f->path; });
  ReadPaths(view, "plate", session, &take, [](SessionFootage* f) -> std::string& { return f->plate; });
  Sort(session, &take);
  view.WarnOfOthers();
  return take;
}

/// A text, or an array of them when several boards are fixed to each other; with blanks between.
std::string BoardsOf(TableView& top, const std::string& units) {
  const toml::node* node = top.Get("board");
  const toml::array* several = node ? node->as_array() : nullptr;
  if (!several) return BoardWithUnits(top.Text("board"), units);
  std::string boards;
  for (const toml::node& entry : *several) {
    const auto text = entry.value_exact<std::string>();
    if (!text || text->empty() || text->find(' ') != std::string::npos)
      top.Fail("board", "must be a text in quotes, or an array of such texts without blanks");
    boards += (boards.empty() ? "" : " ") + BoardWithUnits(*text, units);
  }
  return boards;
}

void ReadHead(TableView& top, Session* session) {
  if (top.Text("schema") != kSchema) top.Fail("schema", std::string("must be \"") + kSchema + "\"");
  const std::set<std::string> known = {"m", "cm", "mm"};
  session->units = top.Text("units");
  if (session->units.empty()) {
    top.Fail("units",
             "is missing: say units = \"m\", \"cm\" or \"mm\", the unit of the board's squares and of all lengths given here");
  }
  if (!known.count(session->units))
    top.Fail("units", internal::Quoted(session->units) + " is not a unit: \"m\", \"cm\" or \"mm\"");
  session->source = top.Text("source");
  session->board = BoardsOf(top, session->units);
  session->calibration = top.Text("calibration");
  session->fps_hz = Rate(top);
  if (top.Flag("follow_symlinks")) {
    session->warnings.push_back(
        top.path() +
        ": follow_symlinks is not used any more: only option 'allow-outside' on the command line lets a session "
        "leave its folder");
  }
}

void ReadLists(TableView& top, Session* session) {
  ForEachEntry(
      top, "cameras", [&](TableView view) { session->cameras.push_back(ReadCamera(std::move(view))); },
      [&](const std::string& name) {
        session->cameras.push_back({name, "", "", 0, 0});
      });
  std::set<std::string> names, slugs;
  for (const SessionCamera& camera : session->cameras) {
    const bool is_new = names.insert(camera.name).second;
    if (!is_new) top.Fail("cameras", "camera " + camera.name + " is there twice");
    if (!slugs.insert(Slug(camera.name)).second) top.Fail("cameras", camera.name + " names the folder of another camera");
  }
  ForEachEntry(
      top, "takes", [&](TableView view) { session->takes.push_back(ReadTake(std::move(view), *session)); },
      [&](const std::string& name) { session->takes.push_back(FoundTake(*session, name)); });
  names.clear();
  for (const SessionTake& take : session->takes) {
    if (!names.insert(take.name).second) top.Fail("takes", "take " + take.name + " is there twice");
  }
}

std::string SettingText(const TableView& view, const std::string& key, const toml::node& node) {
  if (const auto text = node.value_exact<std::string>()) return *text;
  if (const auto whole = node.value_exact<int64_t>()) return std::to_string(*whole);
  const auto number = node.value<double>();
  if (!node.is_number() || !number || !std::isfinite(*number))
    view.Fail(key, "must be a text, a number, true, or an array of these");
  return internal::NumberText(*number);
}

/// [run.STAGE]: flags of the stage's command line.
void ReadSettings(TableView& top, Session* session) {
  const toml::node* node = top.Get("run");
  if (!node) return;
  if (!node->is_table()) top.Fail("run", "must hold tables: [run.calibrate]");
  for (const auto& [stage, table] : *node->as_table()) {
    const std::string name(stage.str());
    if (!table.is_table()) top.Fail("run", "must hold tables: [run." + name + "]");
    const TableView view = top.Table("run." + name, *table.as_table());
    std::vector<SessionSetting>& settings = session->settings[name];
    for (const auto& [key, value] : *table.as_table()) {
      SessionSetting setting{std::string(key.str()), {}};
      if (value.is_array()) {
        for (const toml::node& entry : *value.as_array()) setting.values.push_back(SettingText(view, setting.key, entry));
      } else if (!value.is_boolean()) {
        setting.values.push_back(SettingText(view, setting.key, value));
      }
      const bool off = value.is_boolean() ? !*value.value<bool>() : setting.values.empty();
      if (!off) settings.push_back(std::move(setting));
    }
  }
}

toml::table Parse(const std::string& path) {
  std::error_code error;
  RequireRegularFile(path);
  if (fs::file_size(path, error) > kMaxBytes && !error)
    throw FormatError(path, "", "is larger than 16 MiB: not a session file");
  const std::string text = ReadFile(path);
  RequireParsableToml(text, path);
  try {
    return toml::parse(text, path);
  } catch (const toml::parse_error& problem) {
    const toml::source_position at = problem.source().begin;
    throw FormatError(path, "line " + std::to_string(at.line) + ", column " + std::to_string(at.column),
                      std::string(problem.description()));
  }
}

}  // namespace

std::string BoardWithUnits(const std::string& board, const std::string& units) {
  std::vector<std::string> parts;
  std::istringstream in(board);
  for (std::string part; std::getline(in, part, ':');) parts.push_back(part);
  if (parts.empty()) return board;
  std::vector<size_t> lengths = {2};
  if (parts[0] == "charuco") lengths = {2, 3};
  for (const char* marker : {"tag", "tags", "apriltag", "marker", "markers", "aruco"}) {
    if (parts[0] == marker) lengths = {3};
  }
  for (const size_t i : lengths) {
    if (i < parts.size() && !parts[i].empty() && std::isdigit(static_cast<unsigned char>(parts[i].back()))) parts[i] += units;
  }
  for (std::string& part : parts) {
    const bool thickness = part.rfind("two-sided=", 0) == 0;
    if (thickness && std::isdigit(static_cast<unsigned char>(part.back()))) part += units;
  }
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : ":") + part;
  return text;
}

Session ReadSession(const std::string& folder_or_file, bool allow_outside) {
  const bool is_folder = fs::is_directory(folder_or_file);
  const fs::path file = is_folder ? fs::path(folder_or_file) / "mvstudio.toml" : fs::path(folder_or_file);
  if (!fs::exists(file)) {
    throw IoError(folder_or_file,
                  is_folder ? "holds no mvstudio.toml: not a session; make one with mvstudio session init" : "no such session");
  }
  const std::string path = file.string();
  const toml::table table = Parse(path);
  Session session;
  session.folder = file.has_parent_path() ? file.parent_path().string() : ".";
  session.allow_outside = allow_outside;
  if (!allow_outside) session.trusted = TrustedFolders(session.folder, &session.warnings);
  TableView top(path, table, "", &session.warnings);
  ReadHead(top, &session);
  ReadLists(top, &session);
  ReadSettings(top, &session);
  top.WarnOfOthers();
  return session;
}

}  // namespace mvstudio::dataset
