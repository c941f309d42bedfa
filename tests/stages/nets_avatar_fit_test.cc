#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/nets/avatar_fit.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

TEST(BodyTemplates, AreNamedOrFoundInTheModelsFolder) {
  const TempDir folder;
  const std::string first = folder / "bodies/a.npz", second = folder / "bodies/b";
  setenv("MVSTUDIO_MODELS", (folder / "").c_str(), 1);
  EXPECT_THAT(TemplatesOf("auto"), ElementsAre("")) << "the mannequin alone";
  std::filesystem::create_directories(second);
  WriteFileAtomic(first, "body");
  EXPECT_THAT(TemplatesOf("auto"), ElementsAre("", first, second));
  EXPECT_THAT(TemplatesOf("mannequin"), ElementsAre(""));
  EXPECT_THAT(TemplatesOf(second + ",mannequin"), ElementsAre(second, ""));
  unsetenv("MVSTUDIO_MODELS");
}

TEST(BodyTemplates, ThatDoNotExistAreNamed) {
  EXPECT_THAT(MessageOf<UsageError>([] { TemplatesOf("mannequin,no-such-body.npz"); }), HasSubstr("no-such-body.npz"));
  EXPECT_THAT(MessageOf<UsageError>([] { TemplatesOf(","); }), HasSubstr("option 'template'"));
}

/// A fit in which everything was judged and nothing is wrong.
avatar::PersonFit SoundFit() {
  avatar::PersonFit person;
  person.fit.iou = 0.95, person.fit.iou_before = 0.85;
  person.fit.stages = {{"lengths of the bones alone", 0.85, 1, false}, {"offsets", 0.95, 2, true}};
  person.fit.cameras = {{"00_00", 20, 0, 0.85, 0.95, {0.2, 0.1}, 0.1}};
  return person;
}

std::vector<std::string> CodesOf(const avatar::PersonFit& person) {
  const CommandResult result = JudgeFit(person);
  std::vector<std::string> codes;
  for (const auto& warning : result.warnings) codes.push_back(warning.code);
  return codes;
}

TEST(FitWarnings, NameEachHarmfulInput) {
  EXPECT_TRUE(CodesOf(SoundFit()).empty());
  avatar::PersonFit person = SoundFit();
  person.tracked.rejected = {{7, "00_01", 0.4}};
  EXPECT_THAT(CodesOf(person), ElementsAre("BODY-REJECTED")) << "of a frame that was only posed";
  person = SoundFit();
  person.fit.cameras[0].shift_px = {1.5, 0};
  EXPECT_THAT(CodesOf(person), ElementsAre("BODY-CAMERA-SHIFT"));
  person.fit.cameras[0].shift_sigma_px = 0.5;
  EXPECT_TRUE(CodesOf(person).empty()) << "1.5 px of 0.5";
  person = SoundFit();
  person.fit.stages[0].kept = true;
  EXPECT_THAT(CodesOf(person), ElementsAre("BODY-NO-GAIN"));
  person.fit.iou = std::nan("");
  EXPECT_THAT(CodesOf(person), ElementsAre("BODY-NOT-JUDGED"));
  person = SoundFit();
  person.missing = {"camera 00_00, frame 3"};
  EXPECT_THAT(CodesOf(person), ElementsAre("BODY-MISSING"));
}

TEST(FitWarnings, ABodyBesideItsMasksIsNoFit) {
  const auto fit_of = [](std::vector<double> ious) {
    avatar::PersonFit person = SoundFit();
    person.fit.cameras.clear();
    for (const double iou : ious)
      person.fit.cameras.push_back({"00_0" + std::to_string(person.fit.cameras.size()), 20, 0, iou, iou, {0, 0}, 0.1});
    return person;
  };
  const CommandResult shifted = JudgeFit(fit_of({0.23, 0.02, 0.03}));
  EXPECT_EQ(shifted.exit, 4);
  ASSERT_EQ(shifted.errors.size(), 1u);
  EXPECT_EQ(shifted.errors[0].code, "BODY-POOR-FIT");
  EXPECT_THAT(shifted.errors[0].text, HasSubstr("0.03"));
  EXPECT_THAT(CodesOf(fit_of({0.61, 0.70, 0.64})), ElementsAre("BODY-POOR-FIT"));
  EXPECT_THAT(CodesOf(fit_of({0.9, 0.9, 0.8})), ::testing::IsEmpty());
  const CommandResult one = JudgeFit(fit_of({0.93, 0.1, 0.94}));
  EXPECT_EQ(one.exit, 0);
  ASSERT_EQ(one.warnings.size(), 1u);
  EXPECT_THAT(one.warnings[0].text, HasSubstr("camera 00_01"));
}

TEST(FitWarnings, SayWhetherOffsetsWereWorseOrNotBeyondChance) {
  const auto text = [](double offsets_iou) {
    avatar::PersonFit person = SoundFit();
    person.fit.stages[0].kept = true, person.fit.stages[1].kept = false, person.fit.stages[1].held_out_iou = offsets_iou;
    const CommandResult result = JudgeFit(person);
    return result.warnings.at(0).text;
  };
  EXPECT_THAT(text(0.877), HasSubstr("from 0.8500 to 0.8770, but so few time steps"));
  EXPECT_THAT(text(0.84), HasSubstr("did not improve"));
}

TEST(FitJson, WhatWasNotMeasuredIsNull) {
  avatar::PersonFit person = SoundFit();
  person.fit.iou = std::nan("");
  person.camera_gains["00_00"] = {1, 0.9, 1.1};
  person.templates = {{"mannequin", std::nan(""), 1.5, true}};
  const auto json = ToJson(person);
  EXPECT_TRUE(json["held_out_iou"].is_null());
  EXPECT_TRUE(json["templates"][0]["held_out_iou"].is_null());
  EXPECT_EQ(json["camera_gains"]["00_00"][1], 0.9);
  EXPECT_EQ(json["tracked"]["frames"], 0);
}

}  // namespace
}  // namespace mvstudio::stages
