#include "dataset/session/session_scan.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>

#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/fields.h"
#include "dataset/footage/chapters.h"
#include "dataset/session/session_layout.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

std::string Extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

bool IsImageFile(const fs::path& path) {
  const std::string extension = Extension(path);
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

bool IsVideo(const fs::path& path) {
  static const std::set<std::string> extensions = {".mp4", ".m4v", ".mov",  ".mkv", ".webm", ".avi", ".mpg", ".mpeg",
                                                   ".ts",  ".mts", ".m2ts", ".mxf", ".wmv",  ".y4m", ".h264"};
  return extensions.count(Extension(path)) > 0;
}

std::vector<fs::path> Entries(const fs::path& folder) {
  std::vector<fs::path> entries;
  for (const std::string& name : NamesIn(folder.string())) entries.push_back(folder / name);
  return entries;
}

bool HasImages(const fs::path& folder) {
  const auto entries = Entries(folder);
  return std::any_of(entries.begin(), entries.end(), IsImageFile);
}

std::string Relative(const fs::path& path, const fs::path& folder) { return path.lexically_relative(folder).string(); }

using FoundFootage = std::map<std::string, std::vector<fs::path>>;

/// The videos of a folder by name; the chapters of a recording are one, under a pattern.
FoundFootage VideosIn(const fs::path& folder) {
  FoundFootage found;
  for (const fs::path& entry : Entries(folder)) {
    if (fs::is_directory(entry) || !IsVideo(entry)) continue;
    const auto chapter = ChapterOf(entry.string());
    found[chapter ? chapter->recording : entry.stem().string()].push_back(entry);
  }
  for (auto& [name, files] : found) {
    if (files.size() > 1 && ChapterOf(files[0].string())) files = {ChapterPattern(files[0].string())};
  }
  return found;
}

/// Images called 0000, 0001 and so on, or from 1, and nothing else: one camera's frames, no still of each camera.
bool HoldsNumberedFrames(const fs::path& folder) {
  const std::vector<fs::path> entries = Entries(folder);
  std::set<size_t> numbers;
  for (const fs::path& entry : entries) {
    const std::string stem = entry.stem().string();
    if (!IsImageFile(entry) || stem.find_first_not_of("0123456789") != std::string::npos || stem.size() > 9) return false;
    numbers.insert(std::stoul(stem));
  }
  return numbers.size() > 1 && numbers.size() == entries.size() && *numbers.begin() <= 1 &&
         *numbers.rbegin() - *numbers.begin() + 1 == numbers.size();
}

/// A folder of one camera's footage: its images, or its only video.
std::optional<fs::path> FootageOfFolder(const fs::path& folder) {
  if (HasImages(folder)) return folder;
  const FoundFootage videos = VideosIn(folder);
  if (videos.size() == 1 && videos.begin()->second.size() == 1) return videos.begin()->second[0];
  return std::nullopt;
}

/// What lies in a folder: name of a camera (or a take) -> footage.
FoundFootage FootageIn(const fs::path& folder) {
  FoundFootage found = VideosIn(folder);
  for (const fs::path& entry : Entries(folder)) {
    if (fs::is_directory(entry)) {
      if (const auto footage = FootageOfFolder(entry)) found[entry.filename().string()].push_back(*footage);
    } else if (IsImageFile(entry)) {
      found[entry.stem().string()].push_back(entry);
    }
  }
  return found;
}

/// A recorder's table of times beside its footage.
constexpr char kTimestamps[] = "timestamps.csv";

void ListOthers(const fs::path& folder, const fs::path& above, std::vector<std::string>* skipped) {
  for (const fs::path& entry : Entries(folder)) {
    if (fs::is_directory(entry) ? FootageOfFolder(entry).has_value() : IsVideo(entry) || IsImageFile(entry)) continue;
    if (entry.filename() == kTimestamps) continue;
    const bool several = fs::is_directory(entry) && !VideosIn(entry).empty();
    skipped->push_back(Relative(entry, above) + (several ? ": holds several recordings" : ": neither a video nor images"));
  }
}

/// One folder of raw/, with paths from above it; names that cannot be used are left out.
internal::FootageFolder ListFolder(const fs::path& path, const fs::path& above, std::vector<std::string>* skipped) {
  internal::FootageFolder folder{path.filename().string(), {}};
  for (const auto& [name, files] : FootageIn(path)) {
    const std::string why = WhyNotAName(name);
    if (!why.empty()) {
      skipped->push_back(Relative(files[0], above) + ": '" + name + "' " + why + ": it cannot be a camera's name");
      continue;
    }
    for (size_t i = 1; i < files.size(); ++i) {
      skipped->push_back(Relative(files[i], above) + ": camera " + name + " has " + Relative(files[0], above) + " already");
    }
    folder.footage[name] = {Relative(files[0], above)};
  }
  ListOthers(path, above, skipped);
  return folder;
}

void AddMissingChapters(const fs::path& folder, const fs::path& above, std::vector<std::string>* missing) {
  std::map<std::string, std::vector<std::string>> recordings;
  for (const fs::path& entry : Entries(folder)) {
    const auto chapter = ChapterOf(entry.string());
    if (chapter && !fs::is_directory(entry)) recordings[chapter->recording].push_back(entry.string());
  }
  for (const auto& [recording, files] : recordings) {
    for (const std::string& name : MissingChapters(files)) missing->push_back(Relative(folder / name, above));
  }
}

/// Of the recordings in the folders of raw/ that are used, and in those in them.
std::vector<std::string> MissingBelow(const fs::path& raw, const std::vector<internal::FootageFolder>& folders) {
  std::vector<std::string> missing;
  for (const internal::FootageFolder& folder : folders) {
    AddMissingChapters(raw / folder.name, raw.parent_path(), &missing);
    for (const fs::path& entry : Entries(raw / folder.name)) {
      if (fs::is_directory(entry)) AddMissingChapters(entry, raw.parent_path(), &missing);
    }
  }
  return missing;
}

std::vector<internal::FootageFolder> ListFolders(const fs::path& raw, std::vector<std::string>* skipped) {
  const fs::path above = raw.parent_path();
  std::vector<internal::FootageFolder> folders;
  for (const fs::path& entry : Entries(raw)) {
    const std::string name = entry.filename().string(), why = WhyNotAName(name);
    if (!fs::is_directory(entry) || name == "plate") continue;
    if (!why.empty()) {
      skipped->push_back(Relative(entry, above) + ": " + why + ": it cannot be a take's name");
      continue;
    }
    try {
      if (HoldsNumberedFrames(entry)) {
        skipped->push_back(Relative(entry, above) + ": holds numbered images, which are one camera's frames; a take holds " +
                           "a folder for each camera");
        continue;
      }
      folders.push_back(ListFolder(entry, above, skipped));
    } catch (const IoError& error) {  // such as lost+found on a card
      skipped->push_back(error.what());
      continue;
    }
    if (!folders.back().footage.empty()) continue;
    folders.pop_back();
    skipped->push_back(Relative(entry, above) + ": holds no footage");
  }
  return folders;
}

using Plates = std::map<std::string, std::string>;

/// Clean plates, with paths from above raw/.
Plates PlatesIn(const fs::path& raw) {
  Plates plates;
  for (const fs::path& entry : Entries(raw / "plate")) {
    if (IsImageFile(entry)) plates[entry.stem().string()] = Relative(entry, raw.parent_path());
  }
  return plates;
}

bool IsBoardsName(const std::string& take) { return take == "board" || take == "calib" || take == "calibration"; }

SessionTake TakeFrom(const internal::FootageFolder& folder, const Plates& plates) {
  SessionTake take;
  take.name = folder.name;
  if (IsBoardsName(take.name)) take.kind = TakeKind::kBoard;
  for (const auto& [camera, files] : folder.footage) {
    const auto plate = plates.find(camera);
    const bool wants_plate = take.kind == TakeKind::kPeople && plate != plates.end();
    take.footage.push_back({camera, files[0], wants_plate ? plate->second : ""});
  }
  return take;
}

/// Turns folders of cameras into folders of takes; a take named plate holds clean plates.
void TurnAround(const fs::path& raw, std::vector<internal::FootageFolder>* folders, Plates* plates,
                std::vector<std::string>* notes) {
  std::string note;
  *folders = internal::TakesOfCameras(raw.string(), *folders, &note);
  if (!note.empty()) notes->push_back(note);
  for (auto folder = folders->begin(); folder != folders->end();) {
    const bool is_plate = folder->name == "plate";
    if (is_plate) {
      for (const auto& [camera, files] : folder->footage) plates->emplace(camera, files[0]);
    }
    folder = is_plate ? folders->erase(folder) : folder + 1;
  }
}

constexpr ChoiceWords<SessionLayout, 3> kLayouts = {
    {{SessionLayout::kAuto, "auto"}, {SessionLayout::kTakeFirst, "take-first"}, {SessionLayout::kCameraFirst, "camera-first"}}};

/// A path as in the session, whose raw/ the folder is or will be.
std::string InSession(const std::string& path, const fs::path& raw) {
  return (fs::path("raw") / fs::path(path).lexically_relative(raw.filename())).string();
}

}  // namespace

std::string_view ToString(SessionLayout layout) { return WordOf(kLayouts, layout); }

void FromString(const std::string& text, SessionLayout* layout) {
  *layout = KnownChoice(kLayouts, text, "option 'layout' " + text + ": must be one of auto, take-first, camera-first");
}

ScannedSession ScanRaw(const std::string& folder, SessionLayout layout) {
  const fs::path raw = PathOnDisk(folder);
  ScannedSession scanned;
  std::vector<internal::FootageFolder> folders = ListFolders(raw, &scanned.skipped);
  scanned.missing = MissingBelow(raw, folders);
  Plates plates = PlatesIn(raw);
  scanned.layout = layout;
  if (layout == SessionLayout::kAuto) {
    const internal::FoundLayout found = internal::FindLayout(folders, !plates.empty());
    scanned.layout = found.layout;
    if (!found.conflict.empty()) scanned.notes.push_back(found.conflict);
  }
  const bool rotated = scanned.layout == SessionLayout::kCameraFirst && !folders.empty();
  if (rotated) TurnAround(raw, &folders, &plates, &scanned.notes);
  std::set<std::string> cameras;
  for (const internal::FootageFolder& found : folders) {
    SessionTake take = TakeFrom(found, plates);
    for (SessionFootage& footage : take.footage) {
      footage.path = InSession(footage.path, raw);
      if (!footage.plate.empty()) footage.plate = InSession(footage.plate, raw);
      cameras.insert(footage.camera);
    }
    if (!rotated && fs::is_regular_file(raw / take.name / kTimestamps))
      take.timestamps = (fs::path("raw") / take.name / kTimestamps).string();
    scanned.takes.push_back(std::move(take));
  }
  std::stable_sort(scanned.takes.begin(), scanned.takes.end(), [](const SessionTake& a, const SessionTake& b) {
    return a.kind == TakeKind::kBoard && b.kind != TakeKind::kBoard;
  });
  for (const std::string& camera : cameras) scanned.cameras.push_back({camera, "", "", 0, 0});
  return scanned;
}

ScannedSession ScanSession(const std::string& folder) { return ScanRaw((fs::path(folder) / "raw").string()); }

bool IsVideoFile(const std::string& path) { return IsVideo(path); }

SessionTake ScanFolder(const std::string& folder, std::vector<SessionCamera>* cameras) {
  SessionTake take;
  take.name = fs::path(PathOnDisk(folder)).filename().string();
  for (const auto& [camera, files] : FootageIn(folder)) {
    if (!WhyNotAName(camera).empty()) continue;
    if (fs::is_directory(files[0]) && !VideosIn(files[0]).empty()) continue;  // CAMERA/TAKE.mp4 beside CAMERA/plate.png
    take.footage.push_back({camera, Relative(files[0], folder), ""});
    cameras->push_back({camera, "", "", 0, 0});
  }
  return take;
}

namespace internal {

std::vector<SessionFootage> ScanFootage(const Session& session, const std::string& take) {
  const fs::path raw = fs::path(session.folder) / "raw";
  auto found = FootageIn(raw / take);
  if (found.empty()) found = FootageIn(raw / Slug(take));
  const Plates plates = PlatesIn(raw);
  std::vector<SessionFootage> footage;
  for (const SessionCamera& camera : session.cameras) {
    auto files = found.find(camera.name);
    if (files == found.end()) files = found.find(Slug(camera.name));
    if (files == found.end()) continue;
    if (files->second.size() > 1) {
      throw FormatError((fs::path(session.folder) / "mvstudio.toml").string(), "takes: " + take,
                        "camera " + camera.name + " has two: " + files->second[0].filename().string() + " and " +
                            files->second[1].filename().string() + "; name one under [takes.footage]");
    }
    const auto plate = plates.find(camera.name);
    footage.push_back({camera.name, Relative(files->second[0], session.folder), plate == plates.end() ? "" : plate->second});
  }
  return footage;
}

}  // namespace internal
}  // namespace mvstudio::dataset
