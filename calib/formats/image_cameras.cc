#include <algorithm>
#include <map>
#include <set>

#include "calib/formats/format_camera.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"

namespace mvstudio::calib::internal {
namespace {

using Names = std::vector<std::string>;
using Groups = std::map<std::string, std::vector<size_t>>;

constexpr double kSameDirection = DegToRad(0.05), kSamePlace = 1e-3;  ///< the latter of the rig's extent

/// Folders and stem of a path.
Names PartsOf(const std::string& path) {
  Names parts;
  for (size_t at = 0; at <= path.size();) {
    const size_t end = std::min(path.find_first_of("/\\", at), path.size());
    const std::string part = path.substr(at, end - at);
    if (!part.empty() && part != ".") parts.push_back(part);
    at = end + 1;
  }
  if (!parts.empty()) parts.back() = Stem(parts.back());
  return parts;
}

/// For each image its folders without those that all share, joined.
Names FolderNames(const std::vector<ImageCamera>& images) {
  std::vector<Names> folders;
  for (const ImageCamera& image : images) {
    folders.push_back(PartsOf(image.path));
    if (!folders.back().empty()) folders.back().pop_back();
  }
  const auto all_share = [&](bool front) {
    return std::all_of(folders.begin(), folders.end(), [&](const Names& own) {
      return !own.empty() && (front ? own.front() == folders[0].front() : own.back() == folders[0].back());
    });
  };
  for (const bool front : {true, false}) {
    while (all_share(front)) {
      for (Names& own : folders) own.erase(front ? own.begin() : own.end() - 1);
    }
  }
  Names joined;
  for (const Names& own : folders) {
    joined.emplace_back();
    for (const std::string& part : own) joined.back() += (joined.back().empty() ? "" : "_") + part;
  }
  return joined;
}

Names StemNames(const std::vector<ImageCamera>& images) {
  Names names;
  for (const ImageCamera& image : images) {
    const Names parts = PartsOf(image.path);
    names.push_back(parts.empty() ? image.name : parts.back());
  }
  return names;
}

/// Without the number at its end, of three digits or more: `cam1_0007` is of cam1.
Names WithoutNumbers(Names names) {
  for (std::string& name : names) {
    const size_t last = name.find_last_not_of("0123456789");
    if (last == std::string::npos || name.size() - last - 1 < 3) continue;
    const size_t end = name.find_last_not_of("_-. ", last);
    name = end == std::string::npos || end == last ? std::string() : name.substr(0, end + 1);
  }
  return names;
}

Groups GroupsOf(const Names& names) {
  Groups groups;
  for (size_t i = 0; i < names.size(); ++i) groups[names[i]].push_back(i);
  return groups;
}

double ExtentOf(const std::vector<ImageCamera>& images) {
  const Eigen::Vector3d first = images[0].camera.CenterInWorld();
  double extent = 0;
  for (const ImageCamera& image : images) extent = std::max(extent, (image.camera.CenterInWorld() - first).norm());
  return extent;
}

bool SameCamera(const geometry::RigCamera& a, const geometry::RigCamera& b, double extent) {
  const geometry::Camera &lens = a.camera, &other = b.camera;
  return lens.model == other.model && lens.width_px == other.width_px && lens.height_px == other.height_px &&
         (lens.params - other.params).cwiseAbs().maxCoeff() <= 1e-6 * lens.params.cwiseAbs().maxCoeff() &&
         geometry::RotationAngle(a.cam_from_world.rotation, b.cam_from_world.rotation) <= kSameDirection &&
         (a.CenterInWorld() - b.CenterInWorld()).norm() <= kSamePlace * extent;
}

/// Every name is of one camera, and some name is of several images.
bool StandStill(const Groups& groups, const std::vector<ImageCamera>& images, double extent) {
  if (groups.count("") > 0 || groups.size() == images.size()) return false;
  for (const auto& [name, members] : groups) {
    for (const size_t i : members) {
      if (!SameCamera(images[members[0]].camera, images[i].camera, extent)) return false;
    }
  }
  return true;
}

bool Unique(const Names& names) {
  const std::set<std::string> distinct(names.begin(), names.end());
  return distinct.size() == names.size() && distinct.count("") == 0;
}

void Add(const ImageCamera& image, const std::string& name, ImportedRig* imported) {
  geometry::RigCamera camera = image.camera;
  camera.camera.name = name;
  AddCamera(std::move(camera), image.place, &imported->rig);
}

/// Folders with the same file names in each, whose cameras do not stand still.
void WarnTheyMove(const Names& folders, const Names& stems, ImportedRig* imported) {
  const Groups by_folder = GroupsOf(folders);
  const bool several =
      std::all_of(by_folder.begin(), by_folder.end(), [](const auto& group) { return group.second.size() > 1; });
  if (by_folder.size() < 2 || !several || Unique(stems)) return;
  imported->notes.push_back({"CAL-MOVING",
                             "the images of a folder do not share pose and lens, in " + std::to_string(by_folder.size()) +
                                 " folders: each of the " + std::to_string(folders.size()) + " images is a camera by itself",
                             "if the cameras stood still: let the program that wrote the file keep them fixed, one lens each"});
}

}  // namespace

void AddImageCameras(std::vector<ImageCamera> images, ImportedRig* imported) {
  if (images.empty()) return;
  const Names folders = FolderNames(images), stems = StemNames(images);
  const double extent = ExtentOf(images);
  for (const Names& names : {folders, stems, WithoutNumbers(stems)}) {
    const Groups groups = GroupsOf(names);
    if (!StandStill(groups, images, extent)) continue;
    std::set<std::string> added;
    for (size_t i = 0; i < names.size(); ++i) {
      if (added.insert(names[i]).second) Add(images[i], names[i], imported);
    }
    imported->notes.push_back({"CAL-MERGED",
                               std::to_string(images.size()) + " images are of " + std::to_string(groups.size()) +
                                   " cameras that stand still (" + groups.begin()->first + ", …): one camera each",
                               ""});
    return;
  }
  const bool by_folder = !Unique(stems) && Unique(folders);
  for (size_t i = 0; i < images.size(); ++i) Add(images[i], by_folder ? folders[i] : images[i].name, imported);
  WarnTheyMove(folders, stems, imported);
}

}  // namespace mvstudio::calib::internal
