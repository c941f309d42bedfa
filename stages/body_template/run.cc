#include "stages/body_template/run.h"

#include <filesystem>
#include <map>
#include <optional>

#include "avatar/body/smpl/read.h"
#include "avatar/body/templates/read.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

bool IsSmpl(const std::string& source) { return source != "mannequin" && !fs::is_directory(source); }

void RequireFreeName(const BodyTemplateOptions& options) {
  if (fs::path(options.out).extension() != ".npz") throw UsageError("option 'out' " + options.out + ": must end in .npz");
  if (!IsSmpl(options.source))
    throw UsageError("option 'out': only a .pkl or .npz file is written in SMPL's layout, for " + options.source +
                     " has another skeleton; leave out option 'out', and give " + options.source +
                     " itself to option 'template'");
  if (fs::exists(fs::symlink_status(options.out)))
    throw UsageError("option 'out' " + options.out + " exists: choose another name, or move it away");
}

}  // namespace

BodyTemplateReport RunBodyTemplate(const BodyTemplateOptions& options) {
  BodyTemplateReport report;
  report.options = options;
  if (options.source != "mannequin") {
    if (!fs::exists(options.source))
      throw IoError(options.source,
                    "no such file or folder; it must be mannequin, a folder of MakeHuman, or a .npz or .pkl file");
    report.inputs = {options.source};
  }
  std::optional<OutputFiles> place;
  if (!options.out.empty()) {
    place.emplace(std::vector<std::string>{options.out}, report.inputs);
    RequireFreeName(options);
  }
  std::map<std::string, NpyArray> arrays;
  if (IsSmpl(options.source)) arrays = body::ReadSmplArrays(options.source);
  report.body = arrays.empty() ? body::ReadTemplate(options.source) : body::SmplFromArrays(arrays, options.source);
  if (place) WriteFileAtomic(options.out, body::SmplNpz(arrays, options.source));
  return report;
}

}  // namespace mvstudio::stages
