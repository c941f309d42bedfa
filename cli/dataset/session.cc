#include <algorithm>
#include <charconv>
#include <filesystem>
#include <sstream>

#include "calib/board/board.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/disk/new_folders.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "core/text/shell_word.h"
#include "dataset/session/session_scan.h"
#include "dataset/session/timeline_source.h"
#include "dataset/session/trust.h"
#include "stages/dataset/session_table.h"

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using dataset::Session;
using nlohmann::ordered_json;

struct InitArguments {
  std::string folder, cameras, units, board, scan;
  dataset::SessionLayout layout = dataset::SessionLayout::kAuto;
  double fps = 0;
  bool overwrite = false;
};

struct ShowArguments {
  std::string folder;
  dataset::InspectOptions options;
};

struct TimelineArguments {
  std::string folder, take, out;
  dataset::TakeTimelineOptions options;
};

std::vector<dataset::SessionCamera> CountedCameras(const std::string& text) {
  int count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc() || count < 1 || count > 1000)
    throw UsageError("--cameras " + text + ": a number of cameras is between 1 and 1000");
  std::vector<dataset::SessionCamera> cameras;
  for (int i = 1; i <= count; ++i) {
    cameras.push_back({Format("cam_%02d", i), "", "", 0, 0});
  }
  return cameras;
}

/// "4" is cam_01 to cam_04; else names with commas between them. What looks like a number is never a name.
std::vector<dataset::SessionCamera> NamedCameras(const std::string& text) {
  if (text.empty()) return {};
  const size_t digits = text.find_first_not_of("+-");
  if (digits == std::string::npos || text.find_first_not_of("0123456789", digits) == std::string::npos)
    return CountedCameras(text);
  std::vector<dataset::SessionCamera> cameras;
  std::stringstream names(text);
  for (std::string name; std::getline(names, name, ',');) {
    const std::string why = dataset::WhyNotAName(name);
    if (!why.empty()) throw UsageError("--cameras: '" + name + "' " + why);
    for (const dataset::SessionCamera& other : cameras) {
      if (other.name == name) throw UsageError("--cameras: '" + name + "' is there twice");
    }
    cameras.push_back({name, "", "", 0, 0});
  }
  return cameras;
}

std::string TextOf(const std::string& path) { return fs::exists(path) ? ReadFile(path) : ""; }

/// Takes back the link that raw/ became, unless the session was made: its file is another one then.
struct LinkBack {
  explicit LinkBack(const std::string& session_file) : file(session_file), before(TextOf(file)) {}
  LinkBack(const LinkBack&) = delete;
  LinkBack& operator=(const LinkBack&) = delete;
  ~LinkBack() {
    if (raw.empty()) return;
    try {
      if (TextOf(file) != before) return;
      RemoveOurs({raw});
      if (was_folder) MakeFolder(raw);
    } catch (const std::exception&) {  // on a disk that fails; the next try says what is in the way
    }
  }
  std::string file, before, raw;
  bool was_folder = false;
};

/// Footage that lies elsewhere is not copied: raw/ becomes a link to it.
void LinkRaw(const InitArguments& arguments, LinkBack* back, CommandResult* result) {
  const fs::path raw = fs::path(arguments.folder) / "raw";
  std::error_code error;
  if (!fs::equivalent(raw, arguments.scan, error)) {
    back->raw = raw.string(), back->was_folder = fs::exists(fs::symlink_status(raw));
    PlaceLink(PathOnDisk(arguments.scan), raw.string());
  }
  if (!fs::is_symlink(raw)) return;
  result->warnings.push_back(
      {"SES-OUTSIDE", raw.string() + " is a link to " + arguments.scan + ", outside the session",
       "commands on this session read it with --allow-outside, or once you ran: mvstudio session trust " +
           ShellWord(arguments.folder) + "; copy the footage in place of the link to do without"});
}

void RequireRoomForLink(const InitArguments& arguments) {
  const fs::path raw = fs::path(arguments.folder) / "raw";
  std::error_code error;
  const fs::file_status there = fs::symlink_status(raw, error);
  if (!fs::exists(there) || fs::equivalent(raw, arguments.scan, error)) return;
  if (!fs::is_directory(there) || !fs::is_empty(raw))
    throw UsageError("--scan " + arguments.scan + ": " + raw.string() + " is there already: footage, or a link to it");
}

/// A folder without takes: perhaps it is one.
[[noreturn]] void RefuseScan(const std::string& scan) {
  std::vector<dataset::SessionCamera> cameras;
  dataset::ScanFolder(scan, &cameras);
  if (cameras.empty())
    throw FormatError(scan, "", "holds no footage; expected TAKE/CAMERA.mp4, TAKE/CAMERA/*.png or CAMERA/TAKE.mp4 in it");
  const std::string above = fs::path(PathOnDisk(scan)).parent_path().string();
  throw FormatError(scan, "",
                    "is one take's folder, with footage of " +
                        Join(cameras, ", ", [](const dataset::SessionCamera& camera) { return camera.name; }) +
                        "; give the folder above, --scan " + ShellWord(above) + ", in which each take has such a folder");
}

void TakeScan(const InitArguments& arguments, Session* session, CommandResult* result) {
  if (!arguments.scan.empty()) RequireFolder(arguments.scan, " (--scan)");
  if (!arguments.scan.empty()) RequireRoomForLink(arguments);
  const std::string raw = arguments.scan.empty() ? (fs::path(arguments.folder) / "raw").string() : arguments.scan;
  const dataset::ScannedSession scanned = dataset::ScanRaw(raw, arguments.layout);
  for (const std::string& line : scanned.skipped)
    result->warnings.push_back({"SES-SKIPPED", line, "it is not part of the session"});
  for (const std::string& path : scanned.missing)
    result->warnings.push_back({"SES-CHAPTER", path + " is missing, though later chapters of the recording are there",
                                "copy it from the card too: the frames of a recording are counted through all its chapters"});
  for (const std::string& note : scanned.notes)
    result->warnings.push_back(
        {"SES-LAYOUT", note, "--layout says how the folders are meant; --overwrite writes the session again"});
  if (!arguments.scan.empty() && scanned.takes.empty()) RefuseScan(arguments.scan);
  session->takes = scanned.takes;
  result->metrics["layout"] = std::string(ToString(scanned.layout));
  std::vector<std::string> unnamed;
  for (const dataset::SessionCamera& camera : scanned.cameras) {
    if (session->FindCamera(camera.name) >= 0) continue;
    if (!arguments.cameras.empty()) unnamed.push_back(camera.name);
    session->cameras.push_back(camera);
  }
  if (unnamed.empty()) return;
  result->warnings.push_back({"SES-CAMERA", "not named in --cameras, but with footage, and added: " + Join(unnamed, ", "),
                              "leave --cameras out where the names of the files and folders are the cameras'"});
}

Session SessionOf(const InitArguments& arguments) {
  Session session;
  session.folder = arguments.folder;
  session.units = arguments.units;
  session.board = dataset::BoardWithUnits(arguments.board, arguments.units);
  if (!session.board.empty()) calib::ParseBoard(session.board);  // refused now rather than when it is filmed
  if (arguments.fps > 0) session.fps_hz = arguments.fps;
  session.cameras = NamedCameras(arguments.cameras);
  return session;
}

/// Everything that `init` writes; nothing stays of it when a step fails.
void WriteInit(const InitArguments& arguments, const Session& session, CommandResult* result) {
  const fs::path folder = arguments.folder, file = folder / "mvstudio.toml";
  NewFolders folders;
  folders.Make(arguments.folder);
  LinkBack back(file.string());
  if (!arguments.scan.empty()) LinkRaw(arguments, &back, result);
  for (const char* name : {"sync", "calib", "pose2d", "masks", "pose3d", "dataset", "avatar"}) {
    folders.Make((folder / name).string());
  }
  if (arguments.scan.empty()) folders.Make((folder / "raw").string());
  dataset::WriteSession(session, true);
  back.raw.clear();
  dataset::ReadSession(arguments.folder);  // what was written can be read
  folders.Keep();
}

CommandResult RunInit(const InitArguments& arguments) {
  const fs::path file = fs::path(arguments.folder) / "mvstudio.toml";
  if (fs::exists(file) && !arguments.overwrite) throw UsageError(file.string() + ": exists already; --overwrite replaces it");
  if (arguments.units != "m" && arguments.units != "cm" && arguments.units != "mm") {
    throw UsageError("--units must be m, cm or mm: the unit of the board's squares and of all lengths in the session");
  }
  CommandResult result;
  Session session = SessionOf(arguments);
  TakeScan(arguments, &session, &result);
  WriteInit(arguments, session, &result);
  result.outputs.push_back({file.string(), "session"});
  result.metrics["cameras"] = session.cameras.size();
  result.metrics["takes"] = session.takes.size();
  result.text = std::to_string(session.cameras.size()) + " cameras, " + std::to_string(session.takes.size()) + " takes\n";
  if (session.takes.empty()) {
    result.text +=
        "put footage into raw/TAKE/CAMERA.mp4 and run session init again with --scan raw --overwrite, or name it in "
        "mvstudio.toml\n";
  }
  return result;
}

CommandResult RunShow(const ShowArguments& arguments, CommandContext& context) {
  CommandResult result;
  const Session session = dataset::ReadSession(arguments.folder, arguments.options.allow_outside);
  const dataset::SessionReport report = dataset::InspectSession(session, arguments.options, context.run);
  result.inputs = {arguments.folder};
  result.metrics = {{"units", session.units}, {"board", session.board}, {"cameras", ordered_json::array()}};
  for (const dataset::SessionCamera& c : session.cameras) {
    result.metrics["cameras"].push_back({{"name", c.name}, {"serial", c.serial}, {"lens", c.lens}});
  }
  result.metrics["footage"] = stages::FootageJson(report);
  result.text = stages::FootageText(report);
  stages::AddFindings(report, &result);
  return result;
}

struct TrustArguments {
  std::string folder;
  bool forget = false;
};

CommandResult RunTrust(const TrustArguments& arguments) {
  CommandResult result;
  const Session session = dataset::ReadSession(arguments.folder, true);
  const std::vector<std::string> folders = arguments.forget ? std::vector<std::string>{} : dataset::FoldersOutside(session);
  dataset::TrustSession(session.folder, folders);
  result.inputs = {arguments.folder};
  result.metrics = {{"folders", folders}, {"file", dataset::TrustFile()}};
  result.text = folders.empty() ? "reads nothing outside its folder without --allow-outside\n"
                                : "reads from now on, until it is moved: " + Join(folders, ", ") + "\n";
  return result;
}

CommandResult RunTimeline(const TimelineArguments& arguments, CommandContext& context) {
  CommandResult result;
  const Session session = dataset::ReadSession(arguments.folder, arguments.options.allow_outside);
  const dataset::SessionTake& take = dataset::TakeOf(session, arguments.take);
  const dataset::TakeTimeline made = dataset::BuildTakeTimeline(session, take, arguments.options, context.run);
  for (const std::string& warning : session.warnings) result.warnings.push_back({"SES-KEY", warning, ""});
  for (const std::string& note : made.notes) result.warnings.push_back({"SES-TIMELINE", note, ""});
  for (const dataset::CameraTimeline& c : made.timeline.cameras) {
    if (c.status == dataset::ClockStatus::kNoTime || c.status == dataset::ClockStatus::kNoOffset) result.exit = kExitPartial;
  }
  std::vector<std::string> unfilmed;
  for (const dataset::SessionCamera& camera : session.cameras) {
    const auto filmed = [&](const dataset::SessionFootage& f) { return f.camera == camera.name; };
    if (std::none_of(take.footage.begin(), take.footage.end(), filmed)) unfilmed.push_back(camera.name);
  }
  if (!unfilmed.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back({"SES-NO-FOOTAGE", "take " + take.name + " has no footage of " + Join(unfilmed, ", "),
                               "name it in mvstudio.toml; `mvstudio doctor` lists what is there"});
  }
  const std::string path = arguments.out.empty() ? dataset::TimelinePath(session, take.name) : arguments.out;
  for (const dataset::SessionFootage& f : take.footage) result.inputs.push_back((fs::path(session.folder) / f.path).string());
  std::optional<OutputFiles> place;
  if (!arguments.out.empty()) place.emplace(std::vector<std::string>{path}, result.inputs);
  dataset::WriteTimeline(made.timeline, path);
  result.outputs.push_back({path, "timeline"});
  result.metrics = stages::TimelineJson(made.timeline);
  result.text = stages::TimelineText(made.timeline);
  return result;
}

void RegisterInit(CLI::App* session, Registry& registry) {
  auto arguments = std::make_shared<InitArguments>();
  CLI::App* sub = session->add_subcommand("init", "Make a session: its folders and a commented mvstudio.toml");
  AddOutput(sub, "folder", arguments->folder, OutputKind::kFolder, "the session's folder")->required();
  AddOption(sub, "--units", arguments->units, "m, cm or mm: of the board's squares and of all lengths in the session")
      ->required();
  AddOption(sub, "--cameras", arguments->cameras, "how many (cam_01, cam_02, …), or their names with commas between them");
  AddOption(sub, "--board", arguments->board, "the calibration board, as calibrate --board takes it");
  AddOption(sub, "--scan", arguments->scan,
            "folder with TAKE/CAMERA.mp4 or TAKE/CAMERA/*.png, or with CAMERA/TAKE.mp4; another than FOLDER/raw is linked to, "
            "not copied");
  AddChoice(sub, "--layout", arguments->layout,
            "how the folders are read: take-first (TAKE/CAMERA.mp4), camera-first (CAMERA/TAKE.mp4), or auto: by their names");
  AddOption(sub, "--fps", arguments->fps, "Hz; frame rate of image folders")->check(CLI::PositiveNumber);
  AddFlag(sub, "--overwrite", arguments->overwrite, "replace an existing mvstudio.toml");
  registry.Add(sub, "session init", [arguments](CommandContext&) { return RunInit(*arguments); });
}

void RegisterShow(CLI::App* session, Registry& registry) {
  auto arguments = std::make_shared<ShowArguments>();
  CLI::App* sub = session->add_subcommand("show", "Cameras, takes and footage, and what is wrong with them");
  AddOption(sub, "folder", arguments->folder, "the session's folder")->required();
  AddFlag(sub, "--decode", arguments->options.decode, "decode every frame, instead of reading time stamps only");
  AddFlag(sub, "--allow-outside", arguments->options.allow_outside, "allow the session to name files outside its folder");
  arguments->options.compare = false;
  registry.Add(sub, "session show", [arguments](CommandContext& context) { return RunShow(*arguments, context); });
}

void RegisterTrust(CLI::App* session, Registry& registry) {
  auto arguments = std::make_shared<TrustArguments>();
  CLI::App* sub = session->add_subcommand("trust", "Let a session read its footage outside its folder from now on");
  AddOption(sub, "folder", arguments->folder, "the session's folder")->required();
  AddFlag(sub, "--forget", arguments->forget, "take the trust back");
  registry.Add(sub, "session trust", [arguments](CommandContext&) { return RunTrust(*arguments); });
}

void RegisterTimeline(CLI::App* session, Registry& registry) {
  auto arguments = std::make_shared<TimelineArguments>();
  CLI::App* sub =
      session->add_subcommand("timeline", "Which frame of each camera shows each time step; dropped and doubled frames");
  AddOption(sub, "folder", arguments->folder, "the session's folder")->required();
  AddOption(sub, "--take", arguments->take, "its only take with people unless given");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "file; FOLDER/sync/TAKE.timeline.json unless given");
  AddOption(sub, "--reference", arguments->options.timeline.reference, "camera whose frames count the time steps");
  AddOption(sub, "--max-residual-ms", arguments->options.timeline.max_residual_ms,
            "time steps farther from a frame have none; 0: half a frame of that camera")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  AddFlag(sub, "--find-repeats", arguments->options.find_repeats,
          "look for frames that only repeat the image before; decodes all");
  AddFlag(sub, "--allow-outside", arguments->options.allow_outside, "allow the session to name files outside its folder");
  registry.Add(sub, "session timeline", [arguments](CommandContext& context) { return RunTimeline(*arguments, context); });
}

}  // namespace

void RegisterSession(CLI::App& app, Registry& registry) {
  CLI::App* session = app.add_subcommand("session", "Sessions: folders with footage and mvstudio.toml");
  session->require_subcommand(1);
  RegisterInit(session, registry);
  RegisterShow(session, registry);
  RegisterTrust(session, registry);
  RegisterTimeline(session, registry);
}

}  // namespace mvstudio::cli
