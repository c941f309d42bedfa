#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/notice.h"
#include "report/page/html.h"

namespace mvstudio::report {

struct ReportOptions {
  std::vector<std::string> with;    ///< further folders whose scored avatars are compared with those of the run
  std::string title;                ///< empty: the run folder's name
  std::string audience = "studio";  ///< or "client": the result alone, without paths, command lines and advice
  std::string generated_at;         ///< shown as it is; empty: left out (the library reads no clock)
  std::string version;              ///< of the program that writes the report
  bool follow_links = false;        ///< read what lies outside of the run's folder, too
  int max_heldout_images = 24;      ///< of each evaluation; the rest is listed by name
  int max_image_mb = 8;             ///< a larger image is named, not embedded
  int max_images_total_mb = 48;     ///< all images together
};

template <class Visitor>
void VisitFields(Visitor&& visit, ReportOptions& o) {
  visit("with", o.with, "folders of other runs: their scored avatars stand beside those of this one");
  visit("title", o.title, "title of the page; the run folder's name by default");
  visit("for", o.audience,
        "studio, or client: begins with videos of the avatar and leaves paths, command lines, the machine and what to fix out");
  visit("follow-links", o.follow_links,
        "embed images, and read results, that a run names or links to outside of its folder; off names them instead");
  visit("max-heldout-pictures", o.max_heldout_images, "images shown of each evaluation");
  visit("max-picture-mb", o.max_image_mb, "MB; a larger image is named instead of embedded");
  visit("max-pictures-total-mb", o.max_images_total_mb, "MB of images embedded in all");
}

struct Report {
  std::string html;                    ///< one self-contained document
  std::string json;                    ///< schema mvstudio.report/1: the same numbers
  std::string sentence;                ///< the verdict in words, as the page begins
  Verdict verdict = Verdict::kNotRun;  ///< the worst of the stages
  int num_stages = 0;                  ///< results found
  std::vector<Notice> warnings;        ///< files that could not be used
};

/// Reads the files below `run_folder` (four levels deep): `*.result.json`, `calibration.json`, `points.csv`,
/// `history.csv`, `provenance.jsonl` and the images that the results list. An unreadable file, and a path that leads out of
/// the folder, becomes a warning of the report. Of the folders `with`, only results of `avatar eval` and `avatar train` are
/// taken, with their absolute paths. Throws UsageError for an unknown audience, and IoError when a folder is missing or
/// contains nothing to report.
Report BuildReport(const std::string& run_folder, const ReportOptions& options = {});

/// Path of a page's numbers: beside it, with the extension .json. Throws UsageError when that is the page itself.
std::string NumbersPath(const std::string& html_path);

/// Writes `html_path` and, beside it with the extension .json, the same numbers; returns the path of the latter.
std::string WriteReport(const Report& report, const std::string& html_path);

}  // namespace mvstudio::report
