#include "dataset/panoptic/sequence.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

bool IsImage(const fs::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".jpg" || extension == ".png" || extension == ".jpeg";
}

bool IsVideo(const fs::path& path) {
  for (const char* extension : {".mp4", ".mpg", ".mpeg", ".avi", ".mkv", ".mov"}) {
    if (path.extension() == extension) return true;
  }
  return false;
}

/// The eight digits at the end of `stem` after `prefix`, -1 when the name is another.
int NumberAfter(const std::string& stem, const std::string& prefix) {
  if (stem.size() != prefix.size() + 8 || stem.compare(0, prefix.size(), prefix) != 0) return -1;
  const std::string digits = stem.substr(prefix.size());
  return digits.find_first_not_of("0123456789") == std::string::npos ? std::stoi(digits) : -1;
}

class Scanner {
 public:
  Scanner(const std::string& root, bool follow_links) : follow_links_(follow_links) {
    sequence_.root = root;
    std::error_code ignored;
    canonical_root_ = fs::canonical(root, ignored);
  }

  PanopticSequence Run() {
    sequence_.calibration = FindPanopticCalibration(sequence_.root);
    if (!Inside(fs::directory_entry(sequence_.calibration)))
      throw FormatError(sequence_.calibration, "", "is a symbolic link that leads out of the sequence");
    sequence_.name = fs::path(sequence_.calibration).stem().string().substr(std::string("calibration_").size());
    for (const char* kind : {"hd", "vga", "kinect"}) {
      Images(std::string(kind) + "Imgs", kind);
      Videos(std::string(kind) + "Videos", kind);
    }
    Scenes({"hdPose3d_stage1_coco19", "hdPose3d_stage1_op25", "hdPose3d_stage1"}, &sequence_.hd_scenes);
    Scenes({"vgaPose3d_stage1_coco19", "vgaPose3d_stage1"}, &sequence_.vga_scenes);
    Frames("hdFace3d", "faceRecon3D_hd", &sequence_.faces);
    Frames("hdHand3d", "handRecon3D_hd", &sequence_.hands);
    sequence_.sync = Single("synctables_");
    sequence_.kinect_sync = Single("ksynctables_");
    return std::move(sequence_);
  }

 private:
  /// Notes entries that are links to somewhere outside and says whether an entry may be read.
  bool Inside(const fs::directory_entry& entry) {
    std::error_code error;
    if (!entry.is_symlink(error)) return true;
    const fs::path target = fs::weakly_canonical(entry.path(), error);
    const auto [end, unused] = std::mismatch(canonical_root_.begin(), canonical_root_.end(), target.begin(), target.end());
    if (!error && end == canonical_root_.end()) return true;
    sequence_.links_out.emplace_back(entry.path().string(), target.string());
    return follow_links_;
  }

  /// Without hidden ones, such as the list of what mvstudio wrote there.
  std::vector<fs::directory_entry> List(const std::string& folder) {
    std::vector<fs::directory_entry> entries;
    for (const std::string& name : NamesIn(folder)) {
      const fs::directory_entry entry(fs::path(folder) / name);
      if (Inside(entry)) entries.push_back(entry);
    }
    return entries;
  }

  /// The path of a folder of the sequence that may be read; empty otherwise.
  std::string Folder(const std::string& name) {
    const fs::directory_entry entry(fs::path(sequence_.root) / name);
    std::error_code error;
    return entry.is_directory(error) && Inside(entry) ? entry.path().string() : "";
  }

  void Strange(const fs::path& path, const std::string& why) { sequence_.strange.emplace_back(path.string(), why); }

  bool CameraOf(const std::string& name, const std::string& kind) const {
    int panel = 0, node = 0;
    return ParsePanopticName(name, &panel, &node) && ToString(KindOfPanel(panel)) == kind;
  }

  /// hdImgs/00_03/00_03_00000012.jpg
  void Images(const std::string& name, const std::string& kind) {
    const std::string folder = Folder(name);
    if (folder.empty()) return;
    for (const fs::directory_entry& camera : List(folder)) {
      const std::string camera_name = camera.path().filename().string();
      std::error_code error;
      if (!camera.is_directory(error) || !CameraOf(camera_name, kind)) {
        Strange(camera.path(), "is no folder of " + kind + " images: those are named %02d_%02d, panel and node");
        continue;
      }
      PanopticFootage footage;
      footage.path = camera.path().string();
      for (const fs::directory_entry& file : List(footage.path)) AddImage(file.path(), camera_name, &footage);
      if (!footage.images.empty()) sequence_.footage[camera_name] = std::move(footage);
    }
  }

  void AddImage(const fs::path& file, const std::string& camera, PanopticFootage* footage) {
    const int number = IsImage(file) ? NumberAfter(file.stem().string(), camera + "_") : -1;
    if (number < 0) return Strange(file, "is not named " + camera + "_%08d.jpg or .png and is not read");
    if (!footage->images.emplace(number, file.filename().string()).second)
      Strange(file, "is a second image of frame " + std::to_string(number) + " and is not read");
  }

  /// hdVideos/hd_00_03.mp4, vgaVideos/KINECTNODE4/vga_04_07.mp4
  void Videos(const std::string& name, const std::string& kind) {
    const std::string folder = Folder(name);
    if (folder.empty()) return;
    std::vector<fs::directory_entry> entries = List(folder);
    for (const fs::directory_entry& entry : std::vector<fs::directory_entry>(entries)) {
      std::error_code error;
      if (!entry.is_directory(error)) continue;
      const std::vector<fs::directory_entry> inner = List(entry.path().string());
      entries.insert(entries.end(), inner.begin(), inner.end());
    }
    for (const fs::directory_entry& entry : entries) {
      std::error_code error;
      if (!entry.is_directory(error)) AddVideo(entry.path(), kind);
    }
  }

  void AddVideo(const fs::path& file, const std::string& kind) {
    const std::string stem = file.stem().string(), prefix = kind + "_";
    const std::string camera = stem.compare(0, prefix.size(), prefix) == 0 ? stem.substr(prefix.size()) : "";
    if (!IsVideo(file) || !CameraOf(camera, kind))
      return Strange(file, "is not named " + prefix + "%02d_%02d.mp4 and is not read");
    PanopticFootage& footage = sequence_.footage[camera];
    (footage.path.empty() ? footage.path : footage.other) = file.string();
    footage.is_video = footage.images.empty();
  }

  void Frames(const std::string& name, const std::string& prefix, PanopticFrames* frames) {
    const std::string folder = Folder(name);
    if (folder.empty()) return;
    frames->folder = folder;
    std::vector<fs::directory_entry> files = List(folder);
    for (const char* inside : {"hd", "vga"}) {  // as CMU's first archives unpack
      std::error_code error;
      const auto found = std::find_if(files.begin(), files.end(), [&](const fs::directory_entry& entry) {
        return entry.path().filename() == inside && entry.is_directory(error);
      });
      if (found != files.end()) files = List(found->path().string());
    }
    for (const fs::directory_entry& file : files) {
      const int number = file.path().extension() == ".json" ? NumberAfter(file.path().stem().string(), prefix) : -1;
      if (number < 0) {
        Strange(file.path(), "is not named " + prefix + "%08d.json and is not read");
      } else {
        frames->files[number] = file.path().string();
      }
    }
  }

  /// The first folder that holds scenes.
  void Scenes(const std::vector<std::string>& folders, PanopticFrames* frames) {
    for (const std::string& folder : folders) {
      if (frames->files.empty()) Frames(folder, "body3DScene_", frames);
    }
  }

  std::string Single(const std::string& prefix) {
    const fs::directory_entry entry(fs::path(sequence_.root) / (prefix + sequence_.name + ".json"));
    std::error_code error;
    return entry.exists(error) && Inside(entry) ? entry.path().string() : "";
  }

  PanopticSequence sequence_;
  fs::path canonical_root_;
  bool follow_links_;
};

std::string NamesText(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < std::min<size_t>(names.size(), 5); ++i) text += (i ? ", " : "") + names[i];
  return text + (names.size() > 5 ? ", …" : "");
}

}  // namespace

PanopticKind KindOfPanel(int panel) {
  return panel == 0 ? PanopticKind::kHd : panel == 50 ? PanopticKind::kKinect : PanopticKind::kVga;
}

PanopticKind KindOfCamera(const std::string& name) {
  int panel = 0, node = 0;
  ParsePanopticName(name, &panel, &node);
  return KindOfPanel(panel);
}

std::string ToString(PanopticKind kind) {
  return kind == PanopticKind::kHd ? "hd" : kind == PanopticKind::kVga ? "vga" : "kinect";
}

PanopticSequence ScanPanopticSequence(const std::string& root, bool follow_links) {
  RequireFolder(root, "; a pack (.h5) begins like HDF5, and of an archive give what it holds, unpacked");
  return Scanner(root, follow_links).Run();
}

std::vector<std::string> SelectPanopticCameras(const std::vector<std::string>& names, const std::string& selection) {
  std::set<std::string> words, used;
  std::istringstream in(selection);
  for (std::string word; std::getline(in, word, ',');) words.insert(word);
  std::vector<std::string> selected;
  for (const std::string& name : names) {
    int panel = 0, node = 0;
    const std::string kind = ParsePanopticName(name, &panel, &node) ? ToString(KindOfPanel(panel)) : "";
    const bool by_kind = words.count(kind) > 0, by_name = words.count(name) > 0;
    if (by_kind) used.insert(kind);
    if (by_name) used.insert(name);
    if (by_kind || by_name) selected.push_back(name);
  }
  for (const std::string& word : words) {
    if (!used.count(word))
      throw UsageError("option 'cameras' " + internal::Quoted(word) + ": the calibration has no such camera; it has " +
                       NamesText(names));
  }
  if (selected.empty())
    throw UsageError("option 'cameras' names no camera; it takes hd, vga, kinect and names: " + NamesText(names));
  return selected;
}

}  // namespace mvstudio::dataset
