#include "stages/dataset_import/describe.h"

#include "core/format.h"
#include "stages/dataset/dataset_report.h"

namespace mvstudio::stages {
namespace {

std::string ImportedText(const DatasetImportReport& report) {
  const dataset::PanopticImportReport& imported = report.imported;
  const std::string joints = imported.frames == 0 ? "no joints"
                                                  : Format("joints of %d frames (%d to %d), %d people at most", imported.frames,
                                                           imported.first_frame, imported.last_frame, imported.most_people);
  return report.options.out + Format(": %d cameras, %d with footage; %s; %d faces, %d hands files; %.1f s\n", imported.cameras,
                                     imported.cameras_with_footage, joints.c_str(), imported.faces, imported.hands,
                                     report.wall_s);
}

}  // namespace

CommandResult Describe(const DatasetImportReport& report) {
  const std::string &from = report.options.folder, &out = report.options.out;
  const dataset::PanopticImportReport& imported = report.imported;
  CommandResult result;
  result.inputs = {from};
  result.folder = out;
  result.outputs = {{out, "session"}, {out + "/calib/calibration.json", "calibration"}};
  result.metrics = {{"sequence", imported.sequence},
                    {"takes", imported.takes},
                    {"cameras", imported.cameras},
                    {"cameras_with_footage", imported.cameras_with_footage},
                    {"frames", imported.frames},
                    {"first_frame", imported.first_frame},
                    {"last_frame", imported.last_frame},
                    {"most_people", imported.most_people},
                    {"joints", imported.joints},
                    {"faces", imported.faces},
                    {"hands", imported.hands},
                    {"pictures", imported.images},
                    {"worst_clock_ms", FiniteOrNull(imported.worst_clock_ms)},
                    {"wall_s", report.wall_s}};
  result.Add(DescribeDatasetFindings(imported.findings));
  if (!result.errors.empty()) result.exit = kExitPartial;
  result.text = ImportedText(report);
  if (imported.cameras_with_footage == 0)
    result.warnings.push_back({"DAT-IMAGE", from + ": holds no footage of any camera: calibration and joints alone",
                               "images belong in hdImgs/CAMERA, videos in hdVideos"});
  if (imported.frames > 0 && imported.most_people == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"DAT-POSE",
                             Format("%s: nobody is in any of the %d frames with joints", from.c_str(), imported.frames),
                             "choose other option 'frames'"});
  }
  return result;
}

}  // namespace mvstudio::stages
