#include "stages/calib_files/run.h"

#include <filesystem>

#include "core/disk/output.h"
#include "core/error.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {

CalibShowReport RunCalibShow(const CalibShowOptions& options) {
  calib::ImportedRig imported = ReadCalibrationFiles(options.in, options.read);
  CalibShowReport report{{}, std::move(imported.rig)};
  report.notes.inputs = options.in;
  AddNotes(imported.notes, &report.notes);
  return report;
}

LensAddReport RunLensAdd(const LensAddOptions& options) {
  LensAddReport report;
  report.library = options.library;
  const OutputFiles place({options.library}, {options.calibration});
  const calib::ImportedRig given = ReadCalibrationFiles({options.calibration}, {});
  AddNotes(given.notes, &report.notes);
  report.notes.inputs.push_back(options.calibration);
  const int camera = given.rig.Find(options.camera);
  if (camera < 0) throw UsageError("option 'camera' " + options.camera + ": the calibration has no such camera");
  geometry::Rig& lenses = report.lenses;
  if (std::filesystem::exists(options.library)) lenses = ReadLensLibrary(options.library);
  AddLens(given.rig.cameras[static_cast<size_t>(camera)], options.key, options.replace, &lenses);
  geometry::WriteRig(lenses, options.library);
  report.lens = lenses.cameras[static_cast<size_t>(lenses.Find(LensName(options.key)))];
  return report;
}

LensListReport RunLensList(const std::string& library, bool check) { return {library, ReadLensLibrary(library), check}; }

}  // namespace mvstudio::stages
