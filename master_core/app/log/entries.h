/** Entries of the intervention log about a start: program, options, plan. */
#ifndef FSN_APP_ENTRIES_H
#define FSN_APP_ENTRIES_H

#include "app/base/options.h"
#include "fsn/plan.h"

/** This program starts: version, hash of its file, host, process, user, words of its command line.
 */
void entry_start(int argc, char **argv);

/** The loaded plan: hash, fingerprint, cycle, and its acceptance. */
void entry_plan(const struct fsn_plan *plan, const struct options *options);

/** Output of the signature check of an acceptance record, lines of text. */
void entry_acceptance(const struct options *options, bool as_signed, const char *text);

#endif
