#include <filesystem>
#include <sstream>

#include "core/disk/files.h"
#include "core/format.h"
#include "dataset/json/json_file.h"
#include "dataset/session/session.h"

namespace mvstudio::dataset {
namespace {

constexpr char kHeadComment[] =
    "# A session of mvstudio: what was filmed, by which cameras, and where the footage lies. Paths are relative to this "
    "folder.\n";

/// A TOML basic string.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const unsigned char byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (byte < 0x20 || byte == 0x7f) {
      quoted += Format("\\u%04X", byte);
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

/// Writes `key = value # comment`; keys without a value only as a comment, when comments are asked for.
class Lines {
 public:
  explicit Lines(bool comments) : comments_(comments) {}
  void Raw(const std::string& line) { out_ << line << "\n"; }
  void Comment(const std::string& line) {
    if (comments_) Raw("# " + line);
  }
  void Value(const std::string& key, const std::string& value, const std::string& comment) {
    Raw(key + " = " + value + (comments_ && !comment.empty() ? "  # " + comment : ""));
  }
  void Text(const std::string& key, const std::string& text, const std::string& example, const std::string& comment) {
    if (!text.empty()) return Value(key, Quoted(text), comment);
    Comment(key + " = " + example + (comment.empty() ? "" : "  # " + comment));
  }
  void Number(const std::string& key, const std::optional<double>& number, const std::string& example,
              const std::string& comment) {
    if (number) return Value(key, internal::NumberText(*number), comment);
    Comment(key + " = " + example + (comment.empty() ? "" : "  # " + comment));
  }
  std::string str() const { return out_.str(); }

 private:
  bool comments_;
  std::ostringstream out_;
};

/// Several boards are an array.
void WriteBoards(const std::string& boards, Lines* lines) {
  const char* const note = "as calibrate --board takes it; an array of several that are fixed to each other";
  if (boards.find(' ') == std::string::npos) return lines->Text("board", boards, "\"charuco:8x6:60mm:45mm:4x4_1000\"", note);
  std::istringstream in(boards);
  std::string array;
  for (std::string board; in >> board;) array += (array.empty() ? "" : ", ") + Quoted(board);
  lines->Value("board", "[" + array + "]", note);
}

void WriteCamera(const SessionCamera& camera, bool first, Lines* lines) {
  lines->Raw("\n[[cameras]]");
  lines->Value("name", Quoted(camera.name), first ? "as in the calibration and in the folders of footage" : "");
  if (!camera.serial.empty() || first) {
    lines->Text("serial", camera.serial, "\"22456013\"", "on the camera, or its id in tables of time stamps");
  }
  const std::string size = "[" + std::to_string(camera.width_px) + ", " + std::to_string(camera.height_px) + "]";
  if (camera.width_px > 0) {
    lines->Value("size_px", size, first ? "checked by mvstudio doctor" : "");
  } else if (first) {
    lines->Comment("size_px = [1920, 1080]  # checked by mvstudio doctor");
  }
  if (!camera.lens.empty() || first) lines->Text("lens", camera.lens, "\"8 mm\"", "a note");
}

void WriteTake(const SessionTake& take, bool first, Lines* lines) {
  lines->Raw("\n[[takes]]");
  lines->Value("name", Quoted(take.name), "");
  lines->Value("kind", Quoted(std::string(ToString(take.kind))), first ? "people, board or plate" : "");
  if (take.fps_hz || first) lines->Number("fps_hz", take.fps_hz, "30", "of this take, instead of the session's");
  if (!take.timestamps.empty() || first) {
    lines->Text("timestamps", take.timestamps, "\"raw/take1/timestamps.csv\"", "table of times on a common clock");
  }
  if (!take.sync.empty() || first) {
    lines->Text("sync", take.sync, "\"sync/take1/sync.json\"", "offsets of the cameras, as mvstudio sync writes them");
  }
  lines->Raw("[takes.footage]");
  for (const SessionFootage& footage : take.footage) lines->Value(Quoted(footage.camera), Quoted(footage.path), "");
  bool plates = false;
  for (const SessionFootage& footage : take.footage) plates = plates || !footage.plate.empty();
  if (!plates) return;
  lines->Raw("[takes.plate]");
  for (const SessionFootage& footage : take.footage) {
    if (!footage.plate.empty()) lines->Value(Quoted(footage.camera), Quoted(footage.plate), "");
  }
}

void WriteSettings(const Session& session, bool comments, Lines* lines) {
  if (comments && session.settings.empty()) {
    lines->Raw("");
    lines->Comment("[run.STAGE]: flags that mvstudio run adds to a stage's command line");
    lines->Comment("[run.avatar]");
    lines->Comment("steps = 2000");
  }
  for (const auto& [stage, settings] : session.settings) {
    lines->Raw("\n[run." + Quoted(stage) + "]");
    for (const SessionSetting& setting : settings) {
      std::string values;
      for (const std::string& value : setting.values) values += (values.empty() ? "" : ", ") + Quoted(value);
      const bool several = setting.values.size() > 1;
      lines->Value(Quoted(setting.key), setting.values.empty() ? "true" : several ? "[" + values + "]" : values, "");
    }
  }
}

}  // namespace

std::string SessionText(const Session& session, bool comments) {
  Lines lines(comments);
  if (comments) lines.Raw(kHeadComment);
  lines.Value("schema", "\"mvstudio.session/1\"", "");
  lines.Value("units", Quoted(session.units), "m, cm or mm: of the board's squares and of all lengths given here");
  lines.Text("source", session.source, "\"studio 2, 3 May\"", "a note");
  WriteBoards(session.board, &lines);
  lines.Text("calibration", session.calibration, "\"calib/calibration.json\"", "which calibration the takes were filmed with");
  lines.Number("fps_hz", session.fps_hz, "30", "of footage that does not say it itself, such as folders of images");
  for (size_t i = 0; i < session.cameras.size(); ++i) WriteCamera(session.cameras[i], i == 0, &lines);
  for (size_t i = 0; i < session.takes.size(); ++i) WriteTake(session.takes[i], i == 0, &lines);
  WriteSettings(session, comments, &lines);
  return lines.str();
}

void WriteSession(const Session& session, bool comments) {
  WriteFileAtomic((std::filesystem::path(session.folder) / "mvstudio.toml").string(), SessionText(session, comments));
}

}  // namespace mvstudio::dataset
