#include "stages/calib/lens_library.h"

#include <algorithm>

#include "calib/calibrate.h"
#include "core/error.h"
#include "core/join.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {
namespace {

LensKey KeyOf(const std::string& name) {
  const size_t at = name.find('@');
  return {name.substr(0, at), at == std::string::npos ? "" : name.substr(at + 1)};
}

}  // namespace

std::string LensName(const LensKey& key) { return key.serial + "@" + key.setting; }

geometry::Rig ReadLensLibrary(const std::string& path) {
  const geometry::Rig library = geometry::ReadRig(path);
  const bool named = std::all_of(library.cameras.begin(), library.cameras.end(), [](const geometry::RigCamera& camera) {
    return camera.camera.name.find('@') != std::string::npos;
  });
  if (library.gauge != calib::kLensesOnly || !named)
    throw FormatError(path, "", "is no library of lenses but a calibration; make one with mvstudio calib lenses add");
  return library;
}

void AddLens(const geometry::RigCamera& camera, const LensKey& key, bool replace, geometry::Rig* library) {
  const std::string name = LensName(key);
  if (key.serial.empty() || std::count(name.begin(), name.end(), '@') != 1)
    throw UsageError("a lens needs a serial number, and '@' occurs neither in it nor in the setting: '" + name + "'");
  geometry::RigCamera lens;
  lens.camera = camera.camera, lens.camera.name = name;
  lens.params_covariance = camera.params_covariance;
  library->gauge = calib::kLensesOnly;
  const int found = library->Find(name);
  if (found < 0) return library->cameras.push_back(lens);
  if (!replace) throw UsageError("the library has the lens " + name + " already; option 'replace' replaces it");
  library->cameras[static_cast<size_t>(found)] = lens;
}

geometry::Rig LensesOf(const geometry::Rig& library, const std::vector<dataset::SessionCamera>& cameras) {
  geometry::Rig lenses;
  lenses.gauge = calib::kLensesOnly;
  for (const dataset::SessionCamera& camera : cameras) {
    std::vector<const geometry::RigCamera*> known;
    std::vector<std::string> settings;
    for (const geometry::RigCamera& lens : library.cameras) {
      const LensKey key = KeyOf(lens.camera.name);
      if (camera.serial.empty() || key.serial != camera.serial) continue;
      known.push_back(&lens), settings.push_back(key.setting);
    }
    if (known.empty()) continue;
    const auto named = std::find(settings.begin(), settings.end(), camera.lens);
    if (named == settings.end() && known.size() > 1) {
      throw UsageError("camera " + camera.name + ": the library has several settings of " + camera.serial + " (" +
                       Join(settings, "; ") + "): name one as its `lens` in mvstudio.toml");
    }
    lenses.cameras.push_back(*known[named == settings.end() ? 0 : static_cast<size_t>(named - settings.begin())]);
    lenses.cameras.back().camera.name = camera.name;
  }
  return lenses;
}

}  // namespace mvstudio::stages
