#include "dataset/build/footage_check.h"

#include <set>

#include "core/format.h"
#include "dataset/panoptic/exchanged.h"

namespace mvstudio::dataset::internal {
namespace {

void WarnOfWeakMasks(const BuiltCamera& c, std::vector<Notice>* warnings) {
  constexpr double kLeast = 0.8;
  if (c.joints == 0 || c.joints_supported >= kLeast * c.joints) return;
  warnings->push_back({"DAT-MASK",
                       "camera " + c.alias + ": only " + std::to_string(100 * c.joints_supported / c.joints) +
                           " % of the joints lie where the image shows a person by its colours",
                       "look at the masks; check the calibration and the time offset of this camera, or give a clean plate"});
}

}  // namespace

void WarnOfFootage(const std::vector<CameraResult>& results, const std::map<int, People>& poses, const std::string& folder,
                   const BuildOptions& options, const RunContext& run, std::vector<Notice>* warnings) {
  geometry::Rig rig;
  std::map<std::string, std::string> aliases;
  for (const CameraResult& r : results) rig.cameras.push_back(r.camera), aliases[r.built.name] = r.built.alias;
  const auto image = [&](const std::string& camera, int frame) {
    return folder + "/hdImgs/" + camera + "/" + camera + Format("_%08d", frame) + (options.png ? ".png" : ".jpg");
  };
  std::set<std::string> named;
  for (const ExchangedCameras& found : FindExchanged(rig, poses, image, run)) {
    named.insert({found.a, found.b});
    const std::string a = aliases[found.a], b = aliases[found.b];
    warnings->push_back(
        {"DAT-EXCHANGED", found.Text(a, b),
         "give each its own footage (option 'video' " + a + "=FILE, or the files of the session) and build again"});
  }
  for (const CameraResult& r : results) {
    if (options.masks && named.count(r.built.name) == 0) WarnOfWeakMasks(r.built, warnings);
  }
}

}  // namespace mvstudio::dataset::internal
