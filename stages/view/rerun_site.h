#pragma once

#include <string>

#include "stages/serve/page_server.h"
#include "stages/view/options.h"
#include "stages/view/page_life.h"

namespace mvstudio::stages {

/// Whether `view` shows a file in Rerun's viewer.
bool IsMessagesFile(const std::string& path);

/// The folder of the npm package @rerun-io/web-viewer: `given`, else node_modules/@rerun-io/web-viewer in the working folder;
/// nowhere else, as a file's folder may be somebody else's and its scripts would run. `path`: the file to show. Throws
/// UsageError for a folder that is none, MissingToolError where there is none.
std::string RerunFolder(const std::string& given, const std::string& path);

/// A page with an MCAP file in Rerun's viewer. Nothing but the file and the package's three files is served.
class RerunSite {
 public:
  /// Throws IoError, FormatError for another kind of file, ResourceError for one of more than 1 GiB.
  RerunSite(const ViewOptions& options, std::string package);
  PageAnswer operator()(const PageRequest& request);
  bool is_over() const { return life_.is_over(); }

 private:
  std::string file_, package_, page_;
  PageLife life_;
};

}  // namespace mvstudio::stages
