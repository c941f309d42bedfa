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
  std::string file;     ///< relative to the run folder
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
  std::vector<ReportNotice> warnings;

  std::vector<const Stage*> All(const std::string& command) const;
};

/// Never throws for the content of a file; throws IoError when the folder is missing or contains nothing to report.
RunData ScanRun(const std::string& folder);

/// Commands in the order of the pipeline; unknown ones come after all others.
int PipelineOrder(const std::string& command);

/// File of an output that a result names: the path itself, else below the run folder or the result's own. Empty when there
/// is none.
std::string ResolveOutput(const RunData& data, const Stage& stage, const std::string& path);

}  // namespace mvstudio::report
