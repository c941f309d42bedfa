#include "bench/gpu/report.h"

#include <cstdio>

namespace mvstudio::avatar {

void Report::Table(const std::string& title, const std::vector<std::string>& columns) {
  std::printf("\n%s\n\n", title.c_str());
  Row(columns);
  Row(std::vector<std::string>(columns.size(), "---"));
}

void Report::Row(const std::vector<std::string>& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += " " + cell + " |";
  Line(line);
}

void Report::Line(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

void Report::Check(const std::string& what, const std::string& of, double error, double bound) {
  Row({of, what, Scientific(error), Scientific(bound), Verdict(error <= bound)});  // off for NaN
}

std::string Report::Verdict(bool fine) {
  ++checks_, failed_ += !fine;
  return fine ? "ok" : "**off**";
}

bool Report::TimeFor(const std::string& what) {
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start_;
  if (passed.count() < seconds_) return true;
  ++skipped_;
  std::fprintf(stderr, "bench_gpu: no time left for %s\n", what.c_str());
  return false;
}

std::string Scientific(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1e", value);
  return text;
}

std::string Fixed(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

}  // namespace mvstudio::avatar
