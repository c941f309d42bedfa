#include "report/study/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/page/value.h"
#include "report/study/study_tally.h"
#include "tests/support/hostile_files.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;
using ::testing::Not;

/// A PNG of zeros; `mark` makes its bytes its own.
std::string Png(const std::string& mark, uint32_t size = 8) {
  const std::string png = mvstudio::testing::ZeroPng(size, size, true);
  return png.substr(0, png.size() - 12) + mvstudio::testing::PngChunk("tEXtmark" + std::string(1, '\0') + mark) +
         png.substr(png.size() - 12);
}

StudySpec Spec(int count, uint64_t seed) {
  StudySpec spec;
  spec.title = "Test <study>";
  spec.methods = {"our way", "their way"};
  spec.seed = seed;
  for (int i = 0; i < count; ++i) {
    const std::string name = "00_03_" + std::to_string(i);
    spec.images.push_back({name, Png("truth" + name), Png("first" + name), Png("second" + name)});
  }
  return spec;
}

/// What the page would save if the rater always chose `method`, by the key.
std::string Answers(const Study& study, const std::string& rater, const std::string& method, size_t other_answers = 0) {
  const Value key = Value::Parse(study.json, "key");
  Value list = Value::Array();
  for (const Value& question : key["questions"].items()) {
    const bool left = (question["left"].Text() == method) != (list.items().size() < other_answers);
    list.Append(Value::Object()
                    .Set("picture", question["picture"].Text())
                    .Set("seal", StudySeal(study.sha256, question["picture"].Text(), question["left"].Text()))
                    .Set("choice", left ? "left" : "right")
                    .Set("seconds", 1.5));
  }
  return Value::Object()
      .Set("schema", kStudyAnswersSchema)
      .Set("study", study.sha256)
      .Set("methods", key["methods"])
      .Set("rater", rater)
      .Set("answers", list)
      .Dump();
}

TEST(Study, EachMethodIsOnTheLeftInHalfOfTheQuestionsAndTheSeedShuffles) {
  const Study one = MakeStudy(Spec(12, 1)), again = MakeStudy(Spec(12, 1)), other = MakeStudy(Spec(12, 2));
  EXPECT_EQ(one.html, again.html);
  EXPECT_EQ(one.json, again.json);
  EXPECT_NE(one.sha256, other.sha256);
  const Value key = Value::Parse(one.json, "key");
  int left = 0;
  std::set<std::string> images;
  for (const Value& question : key["questions"].items()) {
    left += question["left"].Text() == "our way";
    EXPECT_NE(question["left"].Text(), question["right"].Text());
    images.insert(question["picture"].Text());
  }
  EXPECT_EQ(left, 6);
  EXPECT_EQ(images.size(), 12u);
}

TEST(Study, ThePageIsWholeAndDoesNotTellTheSides) {
  const Study study = MakeStudy(Spec(6, 3));
  EXPECT_THAT(study.html, HasSubstr("default-src 'none'"));
  EXPECT_THAT(study.html, HasSubstr("script-src 'sha256-"));
  EXPECT_THAT(study.html, HasSubstr("Test &lt;study&gt;"));
  for (const char* outside : {"http://", "https://", "src=\"/", "fetch(", "XMLHttpRequest", "localStorage"})
    EXPECT_THAT(study.html, Not(HasSubstr(outside)));
  // Method names stand once, in the list that the answers carry; nothing of a question depends on them but its seal.
  for (const std::string name : {"our way", "their way"}) EXPECT_EQ(study.html.find(name), study.html.rfind(name)) << name;
}

TEST(Study, ImagesArePairedByName) {
  const TempDir folder;
  for (const char* side : {"truth", "a", "b"}) {
    for (int i = 0; i < 3; ++i) {
      if (std::string(side) == "b" && i == 2) continue;
      WriteFileAtomic(folder / side + ("/p" + std::to_string(i) + ".png"), Png(side));
    }
  }
  std::vector<std::string> unmatched;
  const auto images = ReadStudyImages(folder / "truth", folder / "a", folder / "b", &unmatched);
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[1].name, "p1");
  EXPECT_EQ(images[1].b, Png("b"));
  EXPECT_EQ(unmatched, std::vector<std::string>({"p2"}));
  EXPECT_EQ(ThinStudy(images, 1).size(), 1u);
  WriteFileAtomic(folder / "a/p1.png", Png("a", 9));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadStudyImages(folder / "truth", folder / "a", folder / "b", &unmatched); }),
              HasSubstr("9x9"));
  WriteFileAtomic(folder / "a/p1.png", std::string("no picture"));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadStudyImages(folder / "truth", folder / "a", folder / "b", &unmatched); }),
              HasSubstr("neither PNG nor JPEG"));
  EXPECT_THAT(MessageOf<IoError>([&] { ReadStudyImages(folder / "none", folder / "a", folder / "b", &unmatched); }),
              HasSubstr("none"));
  WriteFileAtomic(folder / "private.png", Png("b"));
  std::filesystem::remove(folder / "a/p1.png");
  std::filesystem::create_symlink(folder / "private.png", folder / "a/p1.png");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadStudyImages(folder / "truth", folder / "a", folder / "b", &unmatched); }),
              HasSubstr("leads out of the folder"));
  EXPECT_EQ(ReadStudyImages(folder / "truth", folder / "a", folder / "b", &unmatched, true).size(), 2u);
  StudySpec same = Spec(2, 1);
  same.methods = {"x", "x"};
  EXPECT_THROW(MakeStudy(same), UsageError);
}

TEST(StudyTally, CountsMethodsNotSides) {
  const TempDir folder;
  const Study study = MakeStudy(Spec(10, 4));
  WriteFileAtomic(folder / "ann.json", Answers(study, "Ann", "our way", 1));
  WriteFileAtomic(folder / "ben.json", Answers(study, "Ben", "their way", 4));
  const StudyTally tally = TallyStudy({ReadStudyAnswers(folder / "ann.json"), ReadStudyAnswers(folder / "ben.json")});
  ASSERT_EQ(tally.raters.size(), 2u);
  EXPECT_EQ(tally.raters[0].chose_a, 9);
  EXPECT_EQ(tally.raters[1].chose_a, 4);
  EXPECT_EQ(tally.pooled.n, 20);
  EXPECT_DOUBLE_EQ(tally.pooled.share_a, 0.65);
  EXPECT_NEAR(tally.raters[0].p_value, 2 * 11 / 1024.0, 1e-14);
}

TEST(StudyTally, RefusesOtherStudiesRepeatsAndEdits) {
  const TempDir folder;
  const Study study = MakeStudy(Spec(10, 4)), other = MakeStudy(Spec(10, 5));
  WriteFileAtomic(folder / "a.json", Answers(study, "Ann", "our way"));
  WriteFileAtomic(folder / "b.json", Answers(other, "Ben", "our way"));
  const StudyAnswers ann = ReadStudyAnswers(folder / "a.json"), ben = ReadStudyAnswers(folder / "b.json");
  EXPECT_THAT(MessageOf<FormatError>([&] { TallyStudy({ann, ben}); }), HasSubstr("different studies"));
  EXPECT_THAT(MessageOf<FormatError>([&] { TallyStudy({ann, ann}); }), HasSubstr("has answered already"));
  EXPECT_THROW(TallyStudy({}), UsageError);
  std::string edited = Answers(study, "Ann", "our way");
  const size_t seal = edited.find("\"seal\":\"") + 8;
  edited[seal] = edited[seal] == 'a' ? 'b' : 'a';
  WriteFileAtomic(folder / "a.json", edited);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadStudyAnswers(folder / "a.json"); }), HasSubstr("answers[0].seal"));
  for (const auto& [name, text] : mvstudio::testing::HostileJson(Answers(study, "Ann", "our way"))) {
    if (name == "nan" || name == "too-large" || name == "many-digits" || name == "infinity") continue;  // of no number we use
    WriteFileAtomic(folder / "a.json", text);
    EXPECT_THROW(ReadStudyAnswers(folder / "a.json"), Error) << name;
  }
}

TEST(StudyTally, IntervalAndTestHaveTheirClosedForms) {
  const auto wilson = WilsonInterval(8, 10);  // Brown, Cai and DasGupta, Statistical Science 2001
  EXPECT_NEAR(wilson[0], 0.4901625, 1e-7);
  EXPECT_NEAR(wilson[1], 0.9433178, 1e-7);
  EXPECT_EQ(WilsonInterval(0, 7)[0], 0);
  EXPECT_EQ(WilsonInterval(7, 7)[1], 1);
  EXPECT_DOUBLE_EQ(SignTest(9, 10), 22 / 1024.0);
  EXPECT_DOUBLE_EQ(SignTest(1, 10), SignTest(9, 10));
  EXPECT_DOUBLE_EQ(SignTest(5, 10), 1);
  EXPECT_EQ(SignTest(0, 0), 1);
  EXPECT_NEAR(SignTest(550, 1000), 0.0017305360849763024, 1e-14);  // scipy.stats.binomtest(550, 1000).pvalue
  EXPECT_NEAR(SignTest(1100, 2000), 8.457089535503812e-06, 1e-16) << "by logarithms";
  double covered = 0;  // exact coverage at p = 0.3, n = 40
  for (int k = 0; k <= 40; ++k) {
    const auto interval = WilsonInterval(k, 40);
    const double probability = std::exp(std::lgamma(41.0) - std::lgamma(k + 1.0) - std::lgamma(41.0 - k) + k * std::log(0.3) +
                                        (40 - k) * std::log(0.7));
    if (interval[0] <= 0.3 && 0.3 <= interval[1]) covered += probability;
  }
  EXPECT_NEAR(covered, 0.95, 0.02);
}

/// The page itself, in a browser: a script that presses the buttons takes the place of the rater.
class StudyInBrowser : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  }
  /// The document after its scripts have run.
  std::string Dom(const std::string& html) const {
    WriteFileAtomic(folder_ / "page.html", html);
    const std::string line = "cd " + folder_.path() +
                             " && timeout 60 chromium --headless --no-sandbox --disable-gpu --user-data-dir=" + folder_.path() +
                             "/profile --virtual-time-budget=5000 --dump-dom file://" + folder_.path() +
                             "/page.html >dom.html 2>log.txt";
    EXPECT_EQ(std::system(line.c_str()), 0);
    return ReadFile(folder_ / "dom.html");
  }
  TempDir folder_;
};

TEST_F(StudyInBrowser, RunsUnderItsOwnPolicy) {
  const std::string dom = Dom(MakeStudy(Spec(3, 1)).html);
  EXPECT_THAT(dom, HasSubstr("<section id=\"ask\" hidden"));
  EXPECT_THAT(dom, HasSubstr("<section id=\"begin\">")) << "the script has run and shows the beginning";
}

TEST_F(StudyInBrowser, AnswersByButtonsAndKeysAreSavedAndCounted) {
  const Study study = MakeStudy(Spec(5, 6));
  std::string html = study.html;
  const size_t policy = html.find("<meta http-equiv=\"Content-Security-Policy\"");
  html.erase(policy, html.find("\n", policy) - policy);  // so that the rater below may run
  const std::string rater = R"js(<script>
    const press = function (id) { document.getElementById(id).click(); };
    const key = function (name) { document.dispatchEvent(new KeyboardEvent('keydown', {key: name})); };
    key('ArrowLeft');  // before the beginning: no answer
    document.getElementById('rater').value = 'Z\u00fc';
    press('start');
    press('choose-left'); key('ArrowRight'); key('Backspace'); press('choose-left'); key('ArrowLeft'); key('ArrowRight');
    press('choose-right');
  </script></body>)js";
  html.replace(html.find("</body>"), 7, rater);
  const std::string dom = Dom(html);
  const std::string mark = "href=\"data:application/json;base64,";
  const size_t begin = dom.find(mark);
  ASSERT_NE(begin, std::string::npos);
  const size_t from = begin + mark.size();
  WriteFileAtomic(folder_ / "base64", dom.substr(from, dom.find('"', from) - from));
  ASSERT_EQ(std::system(("base64 -d " + folder_ / "base64" + " >" + folder_ / "answers.json").c_str()), 0);
  const StudyAnswers answers = ReadStudyAnswers(folder_ / "answers.json");
  EXPECT_EQ(answers.rater, "Z\u00fc");
  EXPECT_EQ(answers.study, study.sha256);
  ASSERT_EQ(answers.answers.size(), 5u);
  const Value key = Value::Parse(study.json, "key");
  const bool left[] = {true, true, true, false, false};
  for (size_t i = 0; i < 5; ++i) {
    const Value& question = key["questions"].At(i);
    EXPECT_EQ(answers.answers[i].image, question["picture"].Text());
    EXPECT_EQ(answers.answers[i].chose_left, left[i]);
    EXPECT_EQ(answers.answers[i].chose_a, (question["left"].Text() == "our way") == left[i]);
  }
}

}  // namespace
}  // namespace mvstudio::report
