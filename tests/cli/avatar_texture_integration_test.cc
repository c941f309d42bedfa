#include <filesystem>

#include "avatar/body/files/atlas.h"
#include "avatar/body/files/textured_person.h"
#include "core/disk/files.h"
#include "tests/cli/avatar_body_fixture.h"
#include "tests/support/test.h"

/// `avatar texture` and `avatar edit` as a program.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarTexture : public AvatarBodyTest<AvatarTexture> {
 protected:
  static void SetUpTestSuite() {
    AvatarBodyTest::SetUpTestSuite();
    if (HasFatalFailure()) return;
    const CliRun train = Train("run", "gaussians",
                               {"--steps", "40", "--colour-degree", "0", "--validate-camera", "00_02", "--save-every", "20"});
    ASSERT_EQ(train.exit, 0) << train.err;
  }

  static CliRun Texture(const std::string& source, const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"avatar", "texture", out(source), "--out", out(name), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
  static CliRun Edit(const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> words = {"avatar", "edit", out("body"), "--out", out(name), "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCli(words);
  }
  static body::TexturedPerson Read(const std::string& name) { return body::ReadPerson(out(name) + "/body.npz"); }
};

TEST_F(AvatarTexture, EveryMethodWritesABodyThatCanBeTrainedOn) {
  const std::vector<std::vector<std::string>> methods = {{"--method", "average"},
                                                         {"--method", "median"},
                                                         {"--method", "graph-cut"},
                                                         {"--method", "refine", "--steps", "20"},
                                                         {"--method", "refine", "--from", "renders", "--views", "6", "--steps",
                                                          "20", "--sharpen", "1.5", "--size", "40", "--render-size", "64"}};
  for (size_t i = 0; i < methods.size(); ++i) {
    const std::string name = "coat" + std::to_string(i);
    const CliRun run = Texture("run", name, methods[i]);
    ASSERT_EQ(run.exit, 0) << run.err;
    const auto metrics = run.Json()["metrics"];
    EXPECT_GT(metrics["images"], 4);
    EXPECT_EQ(metrics["validation"]["after"]["images"], metrics["validation"]["before"]["images"]);
    EXPECT_GT(metrics["validation"]["after"]["psnr_db"], 10);
    for (const char* file : {"body.npz", "body.glb", "texture.png"}) EXPECT_TRUE(fs::exists(out(name) + "/" + file)) << file;
    EXPECT_EQ(Read(name).person.body.vertices, Read("body").person.body.vertices);
    EXPECT_EQ(Read(name).textures[0].width, i == 4 ? 40 : 64);
  }
  const CliRun train = RunCli({"avatar",
                               "train",
                               data(),
                               "--out",
                               out("again"),
                               "--method",
                               "gaussians",
                               "--body",
                               out("coat4"),
                               "--size",
                               "48",
                               "--steps",
                               "5",
                               "--colour-degree",
                               "0",
                               "--train-cameras",
                               "00_00,00_01,00_04",
                               "--holdout-cameras",
                               "00_03",
                               "--holdout-frames",
                               "6-7"});
  EXPECT_EQ(train.exit, 0) << train.err;
}

TEST_F(AvatarTexture, HeldOutImagesAreNotLookedAt) {
  const CliRun run = Texture("run", "seen", {"--method", "median"});
  ASSERT_EQ(run.exit, 0) << run.err;
  for (const auto& [camera, gain] : run.Json()["metrics"]["camera_gains"].items())
    EXPECT_THAT(camera, ::testing::AnyOf("00_00", "00_01", "00_04"));
  EXPECT_EQ(run.Json()["metrics"]["images"], 3 * 6);
}

TEST_F(AvatarTexture, OfABodyTheAverageIsThatOfTheFit) {
  const CliRun run = Texture("body", "average", {"--dataset", data()});
  ASSERT_EQ(run.exit, 0) << run.err;
  for (int k = 0; k < body::kNumParts; ++k) EXPECT_EQ(Read("average").textures[k].pixels, Read("body").textures[k].pixels);
  EXPECT_EQ(run.Json()["metrics"]["validation"]["after"]["images"], 0);
  EXPECT_TRUE(run.Json()["metrics"]["validation"]["after"]["psnr_db"].is_null());
}

TEST_F(AvatarTexture, WhatDoesNotFitTogetherIsRefused) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> refused = {
      {{"--from", "renders"}, "--method refine"},
      {{"--sharpen", "1"}, "--method refine"},
      {{"--method", "refine", "--sharpen", "-1"}, "--sharpen"},
      {{"--method", "mode"}, "graph-cut"},
      {{"--size", "1"}, "--size"},
      {{"--views", "0"}, "--views"}};
  for (const auto& [words, text] : refused) {
    const CliRun run = Texture("run", "refused", words);
    EXPECT_EQ(run.exit, 2) << words[0];
    EXPECT_THAT(run.err, HasSubstr(text));
  }
  EXPECT_THAT(Texture("body", "refused", {}).err, HasSubstr("--dataset"));
  EXPECT_THAT(Texture("body", "refused", {"--dataset", data(), "--method", "refine", "--from", "renders"}).err,
              HasSubstr("training run"));
  EXPECT_EQ(Texture("none", "refused", {"--dataset", data()}).exit, 3);
  EXPECT_FALSE(fs::exists(out("refused") + "/body.npz"));
  const std::string before = ReadFile(out("body") + "/body.npz");
  EXPECT_THAT(Texture("run", "body", {}).err, HasSubstr("--overwrite"));
  EXPECT_EQ(ReadFile(out("body") + "/body.npz"), before);
}

TEST_F(AvatarTexture, AnEditedImageComesBack) {
  Image atlas = dataset::ReadImage(out("body") + "/texture.png");
  ASSERT_EQ(atlas.width, body::AtlasSizePx(64));
  const CliRun same = Edit("same", {"--picture", out("body") + "/texture.png"});
  ASSERT_EQ(same.exit, 0) << same.err;
  EXPECT_EQ(same.Json()["metrics"]["texels_changed"], 0);
  EXPECT_EQ(ReadFile(out("same") + "/texture.png"), ReadFile(out("body") + "/texture.png"));
  for (int x = 10; x < 20; ++x) atlas.Pixel(x, 30)[0] ^= 255;
  dataset::WriteImage(atlas, out("edited.png"));
  const CliRun edited = Edit("edited", {"--picture", out("edited.png")});
  ASSERT_EQ(edited.exit, 0) << edited.err;
  EXPECT_EQ(edited.Json()["metrics"]["texels_changed"], 10);
  EXPECT_EQ(edited.Json()["metrics"]["charts_changed"], 1);
  EXPECT_EQ(*Read("edited").textures[0].Pixel(10 - body::AtlasBorderPx(64), 30 - body::AtlasBorderPx(64)),
            *atlas.Pixel(10, 30));
  dataset::WriteImage(Image(100, 100, 3), out("small.png"));
  const CliRun small = Edit("small", {"--picture", out("small.png")});
  EXPECT_EQ(small.exit, 3);
  EXPECT_THAT(small.err, HasSubstr("360 x 360"));
  EXPECT_FALSE(fs::exists(out("small") + "/body.npz"));
}

TEST_F(AvatarTexture, GirthsChangeTheShapeAndKeepTheColours) {
  const CliRun run = Edit("thick", {"--shape", "trunk=+0.1,leg=-0.05"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_GT(run.Json()["metrics"]["most_move_mm"], 5);
  EXPECT_LT(run.Json()["metrics"]["most_move_mm"], 60);
  const body::TexturedPerson thick = Read("thick"), before = Read("body");
  EXPECT_EQ(thick.textures[3].pixels, before.textures[3].pixels);
  EXPECT_EQ(thick.person.body.bone_heads, before.person.body.bone_heads);
  EXPECT_EQ(thick.person.seen.size(), before.person.seen.size());
  ASSERT_EQ(Edit("none", {"--shape", "trunk=0"}).exit, 0);
  EXPECT_LT((Read("none").person.body.vertices - before.person.body.vertices).norm(), 1e-4);
}

TEST_F(AvatarTexture, WrongShapesAreNamed) {
  const std::vector<std::pair<std::string, std::string>> refused = {{"belly=1", "girths are trunk, head, arm and leg"},
                                                                    {"trunk", "NAME=NUMBER"},
                                                                    {"trunk=", "NAME=NUMBER"},
                                                                    {"trunk=nan", "NAME=NUMBER"},
                                                                    {"trunk=1e9", "NAME=NUMBER"},
                                                                    {"trunk=0.1,trunk=0.2", "twice"},
                                                                    {"trunk=-1", "-0.9"}};
  for (const auto& [shape, text] : refused) {
    const CliRun run = Edit("refused", {"--shape", shape});
    EXPECT_EQ(run.exit, 2) << shape;
    EXPECT_THAT(run.err, HasSubstr(text)) << shape;
  }
  EXPECT_THAT(Edit("refused", {}).err, HasSubstr("--picture"));
  EXPECT_THAT(Edit("refused", {"--shape", "height=1", "--template", "mannequin"}).err, HasSubstr("has no shapes"));
  EXPECT_FALSE(fs::exists(out("refused") + "/body.npz"));
}

TEST_F(AvatarTexture, TheBodyAtRestIsRendered) {
  const CliRun run =
      RunCli({"avatar", "render", out("run"), "--json", "--rest-pose", "--turntable", "2", "--out", out("rest")});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["pictures"], 2);
  EXPECT_EQ(RunCli({"avatar", "render", out("run"), "--rest-pose", "--frames", "6"}).exit, 2);
}

}  // namespace
}  // namespace mvstudio
