#!/usr/bin/env perl
# header.pl FILE.hpp: the header as Doxygen reads it. The comment that it begins with describes the file, up to the first
# list or example, which Doxygen would take apart, and without the paragraph that leads to it.
use strict;
use warnings;

my @lines = <>;
my $end = 0;
$end++ while $end < @lines && $lines[$end] =~ m{^//(?!/)( ?\S.*|\s*)$};
if ($end < @lines && $lines[$end] =~ m{^//}) {
  my $cut = $end;
  $cut-- while $cut > 0 && $lines[$cut - 1] =~ m{^//\s*$};
  $cut-- while $cut > 0 && $lines[$cut - 1] !~ m{^//\s*$};
  # A first paragraph stays, whatever it leads to.
  $end = $cut if $cut > 0;
}
for my $line (@lines[0 .. $end - 1]) {
  my ($text) = $line =~ m{^//(.*)};
  $text = join '', map { /^`/ ? $_ : s/([<>#])/\\$1/gr } split /(`[^`]*`)/, $text;
  # A term of a formula is no item of a list.
  $text =~ s/^(\s*)([-+] )/$1\\$2/;
  print "///$text\n";
}
# The next line says nothing to Doxygen and makes room for the command, so that its warnings name the right lines.
print $end > 0 ? "/// \@file\n" : $lines[0];
print @lines[$end + 1 .. $#lines];
