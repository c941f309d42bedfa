#include "report/study/study_tally.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/value.h"
#include "report/study/study.h"

namespace mvstudio::report {
namespace {

std::string RequireText(const Value& value, const std::string& path, const std::string& where) {
  if (!value.IsText() || value.Text().empty()) throw FormatError(path, where, "is missing or no text");
  return value.Text();
}

StudyAnswer ReadAnswer(const Value& value, const StudyAnswers& file, const std::string& where) {
  StudyAnswer answer;
  answer.image = RequireText(value["picture"], file.path, where + ".picture");
  const std::string seal = RequireText(value["seal"], file.path, where + ".seal");
  const std::string choice = RequireText(value["choice"], file.path, where + ".choice");
  if (choice != "left" && choice != "right") throw FormatError(file.path, where + ".choice", "is neither left nor right");
  const bool a_left = seal == StudySeal(file.study, answer.image, file.methods[0]);
  if (!a_left && seal != StudySeal(file.study, answer.image, file.methods[1]))
    throw FormatError(file.path, where + ".seal", "does not belong to this study; was the file edited?");
  answer.chose_left = choice == "left";
  answer.chose_a = answer.chose_left == a_left;
  answer.seconds = value["seconds"].Number();
  return answer;
}

}  // namespace

StudyAnswers ReadStudyAnswers(const std::string& path) {
  const Value json = Value::Parse(ReadFile(path), path);
  if (json["schema"].Text() != kStudyAnswersSchema)
    throw FormatError(path, "schema", std::string("is not ") + kStudyAnswersSchema);
  StudyAnswers file;
  file.path = path;
  file.study = RequireText(json["study"], path, "study");
  file.rater = RequireText(json["rater"], path, "rater");
  for (size_t i = 0; i < 2; ++i)
    file.methods[i] = RequireText(json["methods"].At(i), path, "methods[" + std::to_string(i) + "]");
  std::set<std::string> seen;
  for (size_t i = 0; i < json["answers"].items().size(); ++i) {
    const std::string where = "answers[" + std::to_string(i) + "]";
    file.answers.push_back(ReadAnswer(json["answers"].At(i), file, where));
    if (!seen.insert(file.answers.back().image).second) throw FormatError(path, where, "answers an image a second time");
  }
  if (file.answers.empty()) throw FormatError(path, "answers", "is empty: nothing was answered");
  return file;
}

std::array<double, 2> WilsonInterval(int64_t k, int64_t n) {
  MVS_CHECK(n > 0 && k >= 0 && k <= n, k << " of " << n);
  constexpr double z = 1.959963984540054;
  const auto count = static_cast<double>(n);
  const double share = static_cast<double>(k) / count, denominator = 1 + z * z / count;
  const double middle = (share + z * z / (2 * count)) / denominator;
  const double half = z * std::sqrt(share * (1 - share) / count + z * z / (4 * count * count)) / denominator;
  return {k == 0 ? 0 : std::max(0.0, middle - half), k == n ? 1 : std::min(1.0, middle + half)};
}

double SignTest(int64_t k, int64_t n) {
  MVS_CHECK(n >= 0 && k >= 0 && k <= n, k << " of " << n);
  const auto count = static_cast<double>(n);
  const int64_t least = std::max(k, n - k);
  constexpr int64_t kExact = 1000;  // 2^-n is still a normal number
  double tail = 0, term = n <= kExact ? std::ldexp(1.0, -static_cast<int>(n)) : 0;
  for (int64_t i = n; i >= least; --i) {
    const auto x = static_cast<double>(i);
    if (n > kExact)
      term = std::exp(std::lgamma(count + 1) - std::lgamma(x + 1) - std::lgamma(count - x + 1) - count * std::log(2.0));
    tail += term;
    term *= x / (count - x + 1);
  }
  return std::min(1.0, 2 * tail);
}

StudyShare MakeShare(const std::string& rater, int64_t n, int64_t chose_a, int64_t chose_left) {
  const std::array<double, 2> interval = WilsonInterval(chose_a, n);
  return {rater,
          n,
          chose_a,
          chose_left,
          static_cast<double>(chose_a) / static_cast<double>(n),
          interval[0],
          interval[1],
          SignTest(chose_a, n)};
}

StudyTally TallyStudy(const std::vector<StudyAnswers>& files) {
  if (files.empty()) throw UsageError("no answers to count");
  StudyTally tally{files[0].study, files[0].methods, {}, {}};
  std::set<std::string> raters;
  int64_t n = 0, chose_a = 0, chose_left = 0;
  for (const StudyAnswers& file : files) {
    if (file.study != tally.study || file.methods != tally.methods) {
      throw FormatError(file.path, "study",
                        "is " + file.study.substr(0, 12) + ", in " + files[0].path + " it is " + tally.study.substr(0, 12) +
                            ": answers to different studies cannot be counted together");
    }
    if (!raters.insert(file.rater).second) throw FormatError(file.path, "rater", "'" + file.rater + "' has answered already");
    StudyShare own;
    for (const StudyAnswer& answer : file.answers) ++own.n, own.chose_a += answer.chose_a, own.chose_left += answer.chose_left;
    tally.raters.push_back(MakeShare(file.rater, own.n, own.chose_a, own.chose_left));
    n += own.n, chose_a += own.chose_a, chose_left += own.chose_left;
  }
  tally.pooled = MakeShare("", n, chose_a, chose_left);
  return tally;
}

}  // namespace mvstudio::report
