#include "dataset/session/session_scan.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

std::string Extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return extension;
}

bool IsPicture(const fs::path& path) {
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

bool HasPictures(const fs::path& folder) {
  const auto entries = Entries(folder);
  return std::any_of(entries.begin(), entries.end(), IsPicture);
}

/// The camera whose footage this is; empty when it is none.
std::string CameraOf(const fs::path& path) {
  if (fs::is_directory(path)) return HasPictures(path) ? path.filename().string() : "";
  return IsVideo(path) || IsPicture(path) ? path.stem().string() : "";
}

std::string Relative(const fs::path& path, const std::string& folder) { return path.lexically_relative(folder).string(); }

/// Camera -> footage of raw/TAKE.
std::map<std::string, std::vector<fs::path>> FootageIn(const fs::path& take) {
  std::map<std::string, std::vector<fs::path>> found;
  for (const fs::path& entry : Entries(take)) {
    const std::string camera = CameraOf(entry);
    if (!camera.empty()) found[camera].push_back(entry);
  }
  return found;
}

/// A recorder's table of times beside its footage.
constexpr char kTimestamps[] = "timestamps.csv";

void ListOthers(const fs::path& take, const std::string& folder, std::vector<std::string>* skipped) {
  for (const fs::path& entry : Entries(take)) {
    if (CameraOf(entry).empty() && entry.filename() != kTimestamps)
      skipped->push_back(Relative(entry, folder) + ": neither a video nor images");
  }
}

SessionTake ScanTake(const fs::path& path, const std::map<std::string, std::string>& plates, const std::string& folder,
                     std::vector<std::string>* skipped) {
  SessionTake take;
  take.name = path.filename().string();
  if (take.name == "board" || take.name == "calib" || take.name == "calibration") take.kind = TakeKind::kBoard;
  for (const auto& [camera, files] : FootageIn(path)) {
    const std::string why = WhyNotAName(camera);
    if (!why.empty()) {
      skipped->push_back(Relative(files[0], folder) + ": '" + camera + "' " + why + ": it cannot be a camera's name");
      continue;
    }
    for (size_t i = 1; i < files.size(); ++i) {
      skipped->push_back(Relative(files[i], folder) + ": camera " + camera + " has " + Relative(files[0], folder) + " already");
    }
    const auto plate = plates.find(camera);
    const bool wants_plate = take.kind == TakeKind::kPeople && plate != plates.end();
    take.footage.push_back({camera, Relative(files[0], folder), wants_plate ? plate->second : ""});
  }
  if (fs::is_regular_file(path / kTimestamps)) take.timestamps = Relative(path / kTimestamps, folder);
  ListOthers(path, folder, skipped);
  return take;
}

std::map<std::string, std::string> Plates(const std::string& folder) {
  std::map<std::string, std::string> plates;
  for (const fs::path& entry : Entries(fs::path(folder) / "raw" / "plate")) {
    if (IsPicture(entry)) plates[entry.stem().string()] = Relative(entry, folder);
  }
  return plates;
}

}  // namespace

ScannedSession ScanSession(const std::string& folder) {
  ScannedSession scanned;
  const auto plates = Plates(folder);
  std::set<std::string> cameras;
  for (const fs::path& entry : Entries(fs::path(folder) / "raw")) {
    const std::string name = entry.filename().string(), why = WhyNotAName(name);
    if (!fs::is_directory(entry) || name == "plate") continue;
    if (!why.empty()) {
      scanned.skipped.push_back(Relative(entry, folder) + ": " + why + ": it cannot be a take's name");
      continue;
    }
    SessionTake take;
    try {
      take = ScanTake(entry, plates, folder, &scanned.skipped);
    } catch (const IoError& error) {  // such as lost+found on a card
      scanned.skipped.push_back(error.what());
      continue;
    }
    if (take.footage.empty()) {
      scanned.skipped.push_back(Relative(entry, folder) + ": holds no footage");
      continue;
    }
    for (const SessionFootage& footage : take.footage) cameras.insert(footage.camera);
    scanned.takes.push_back(std::move(take));
  }
  std::stable_sort(scanned.takes.begin(), scanned.takes.end(), [](const SessionTake& a, const SessionTake& b) {
    return a.kind == TakeKind::kBoard && b.kind != TakeKind::kBoard;
  });
  for (const std::string& camera : cameras) scanned.cameras.push_back({camera, "", "", 0, 0});
  return scanned;
}

SessionTake ScanFolder(const std::string& folder, std::vector<SessionCamera>* cameras) {
  SessionTake take;
  take.name = fs::absolute(folder).lexically_normal().filename().string();
  if (take.name.empty()) take.name = fs::absolute(folder).lexically_normal().parent_path().filename().string();
  for (const auto& [camera, files] : FootageIn(folder)) {
    if (!WhyNotAName(camera).empty()) continue;
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
  const auto plates = Plates(session.folder);
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
