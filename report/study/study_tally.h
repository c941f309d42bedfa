#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

/// Counting the answers of a user study (report/study/study.h).
namespace mvstudio::report {

struct StudyAnswer {
  std::string image;
  bool chose_a = false, chose_left = false;
  double seconds = 0;  ///< NaN when unknown
};

/// One file of answers: one rater.
struct StudyAnswers {
  std::string path, study, rater;  ///< study: its SHA-256
  std::array<std::string, 2> methods;
  std::vector<StudyAnswer> answers;
};

/// Throws IoError, or FormatError with the place: not a file of answers, an image answered twice, a seal that does not
/// belong to this study.
StudyAnswers ReadStudyAnswers(const std::string& path);

/// Fraction of choices of the first method.
struct StudyShare {
  std::string rater;  ///< empty: all together
  int64_t n = 0, chose_a = 0, chose_left = 0;
  double share_a = 0, low = 0, high = 0;  ///< 95 % interval of Wilson
  double p_value = 0;                     ///< two-sided sign test of "both are chosen equally often"
};
StudyShare MakeShare(const std::string& rater, int64_t n, int64_t chose_a, int64_t chose_left);

struct StudyTally {
  std::string study;
  std::array<std::string, 2> methods;
  std::vector<StudyShare> raters;
  StudyShare pooled;
};
/// Throws FormatError naming the file that belongs to another study or repeats a rater, UsageError without files.
StudyTally TallyStudy(const std::vector<StudyAnswers>& files);

/// Confidence bounds of a fraction of k in n (E. B. Wilson, JASA 1927), 95 %. n > 0.
std::array<double, 2> WilsonInterval(int64_t k, int64_t n);
/// Probability under p = 1/2 of a split at least as uneven as k in n, two-sided; 1 for n = 0.
double SignTest(int64_t k, int64_t n);

}  // namespace mvstudio::report
