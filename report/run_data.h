#pragma once

#include <string>
#include <vector>

#include "report/page/html.h"
#include "report/page/table_file.h"
#include "report/page/value.h"
#include "report/report.h"

namespace mvstudio::report {

/// One saved result (`*.result.json`).
struct Stage {
  std::string root;     ///< folder of the run that it belongs to
  std::string file;     ///< relative to that
  std::string folder;   ///< of the file, relative; "" for the run folder itself
  std::string command;  ///< "avatar eval"
  Value result;
  Verdict verdict = Verdict::kNotRun;

  const Value& metrics() const { return result["metrics"]; }
};

struct JsonFile {
  std::string file, folder;
  Value value;
};
struct CsvFile {
  std::string file, folder;
  TableFile table;
};

/// Everything found below a run folder.
struct RunData {
  std::string root;
  std::vector<Stage> stages;           ///< in the order of the pipeline
  std::vector<JsonFile> calibrations;  ///< the run's own first, ground truth left out
  std::vector<CsvFile> points;         ///< 3D joints, ground truth left out
  std::vector<JsonFile> poses;         ///< pose3d.json: whose joints the points are
  std::vector<CsvFile> histories;      ///< training histories
  std::vector<JsonFile> provenance;    ///< one per command, by time
  std::vector<Notice> warnings;

  std::vector<const Stage*> All(const std::string& command) const;
};

/// Never throws for the content of a file; throws IoError when the folder is missing or contains nothing to report. Links that
/// lead out of the folder are warnings, unless `follow_links`.
RunData ScanRun(const std::string& folder, bool follow_links = false);

/// The file at a path below the run's folder (stage.root); empty where there is none or the path leads out of the run.
std::string FileOfRun(const Stage& stage, const std::string& path, bool follow_links);

/// What is said of a path that is not followed.
Notice LeadsOut(const std::string& what);

/// Commands in the order of the pipeline; unknown ones come after all others.
int PipelineOrder(const std::string& command);

/// File of an output that a result names, as it lies below the run's folder or the result's own, also after the run was moved.
struct OutputPlace {
  std::string file;      ///< empty: there is none, or it is not to be read
  bool outside = false;  ///< the path leads out of the run; whether a file is there is then not looked at
};
/// `follow_links`: also outside, by the path itself or through links.
OutputPlace ResolveOutput(const Stage& stage, const std::string& path, bool follow_links);

}  // namespace mvstudio::report
